"""What untrusted data must never meet: a parser that follows it, a shell, an unpickler."""

from __future__ import annotations

import ast
from pathlib import Path

import trace_dag

PACKAGE = Path(trace_dag.__file__).parent


def calls() -> list[tuple[str, str, dict[str, object]]]:
    """Calls of the package: file, what is called, constant keyword arguments."""
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call):
                constants = {
                    keyword.arg: keyword.value.value
                    for keyword in node.keywords
                    if keyword.arg and isinstance(keyword.value, ast.Constant)
                }
                found.append((str(path.relative_to(PACKAGE)), ast.unparse(node.func), constants))
    return found


def test_every_xml_parser_neither_resolves_entities_nor_reaches_the_network():
    parsers = [(file, given) for file, name, given in calls() if name.endswith("XMLParser")]
    assert parsers
    for file, given in parsers:
        assert (given.get("resolve_entities"), given.get("no_network")) == (False, True), file


def test_no_xml_is_read_by_a_parser_of_its_own():
    readers = ("etree.fromstring", "etree.XML", "etree.parse", "ElementTree.fromstring", "minidom.parseString")
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(readers):
                given = len(node.args) > 1 or any(keyword.arg == "parser" for keyword in node.keywords)
                assert given, f"{path.name}:{node.lineno} reads XML without saying with which parser"


FROM_OUR_OWN_SIDE = {"agents/evaluation/agent_main.py", "warehouse/query.py"}
"""An agent's process unpickles what the process that measures sends it, never the other way round. The process of a
question runs our own code alone, and DuckDB there opens no file but the warehouse."""


def test_no_shell_and_nothing_unpickled():
    for file, name, given in calls():
        assert given.get("shell") is not True, file
        assert name not in ("os.system", "os.popen", "eval", "exec"), file
        unpickles = name.endswith(("pickle.load", "pickle.loads", "cloudpickle.loads"))
        assert not unpickles or file in FROM_OUR_OWN_SIDE, file

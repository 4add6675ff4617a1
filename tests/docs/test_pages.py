"""Every command and every block of code in the README and on the documentation site is run.

A block that needs what a test cannot have (a server, a cluster, the network) stands below a comment
``<!-- not run: why -->``: its shell is checked by bash, and its trace-dag commands by the command line's own parser.
Tables and lists are held to be shown as such.
"""

from __future__ import annotations

import csv
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import markdown
import prepared
import pytest
import sample_runs
import yaml
from command_lines import taken_by
from loopback import serving
from model_server import KEY, MODEL, narrating

from tests.crash.test_registers import TEMPE

REPOSITORY = Path(__file__).resolve().parents[2]
PAGES = [REPOSITORY / "README.md", REPOSITORY / "CONTRIBUTING.md", *sorted((REPOSITORY / "docs").rglob("*.md"))]
FENCE = re.compile(
    r"(?:<!-- not run: (?P<reason>[^\n]+) -->\n)?^```(?P<language>\w*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
# Two crashes that are verified, one without a map, one off the road: they show on every page what ten would show.
KNOWN = ("2023-319003", "2023-319022", "2023-319067", "2023-319069")
ARRIVING = ("2023-319001",)  # a crash that the root does not know yet


@dataclass(frozen=True)
class Block:
    """A fenced block; ``commands`` are what a reader would type, without prompts and without what is printed."""

    page: str
    line: int
    language: str
    text: str
    not_run: str | None

    @property
    def commands(self) -> str:
        if self.language != "console":
            return self.text
        return "\n".join(line[2:] for line in self.text.splitlines() if line.startswith("$ "))


def blocks(path: Path) -> Iterator[Block]:
    text = path.read_text()
    page = str(path.relative_to(REPOSITORY))
    for found in FENCE.finditer(text):
        line = text.count("\n", 0, found.start("language")) + 1
        yield Block(page, line, found["language"], found["text"], found["reason"])


BLOCKS = {path: list(blocks(path)) for path in PAGES}
SHELL = ("sh", "console")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where a reader of the pages would stand: reports, maps, an agent, and a root with some of the sample run."""
    sample_runs.copy_finished(tmp_path / "trace_dag_home", KNOWN)
    sample_runs.reports_of(tmp_path / "reports", ARRIVING)
    sample_runs.reports_of(tmp_path / "inbox", ("2023-319005",))
    for maps in ("maps", "more-maps"):
        (tmp_path / maps).symlink_to(sample_runs.SAMPLE / "osm")
    with (tmp_path / "crashes.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, fieldnames=list(TEMPE))
        table.writeheader()
        table.writerow(TEMPE)
    for block in BLOCKS[REPOSITORY / "docs" / "tutorials" / "driving-stack.md"]:
        if "class CarefulFollower" in block.text:
            (tmp_path / "careful.py").write_text(block.text)
    return tmp_path


@pytest.mark.parametrize("path", PAGES, ids=[str(path.relative_to(REPOSITORY)) for path in PAGES])
def test_commands_of_a_page_work_from_the_first_to_the_last(path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch):
    with ExitStack() as running:
        if path.name == "narratives.md":  # a model that has read them
            server = running.enter_context(serving(narrating()))
            monkeypatch.setenv("TRACE_DAG_STATES__LLM_MODEL", MODEL)
            monkeypatch.setenv("OPENAI_API_KEY", KEY)
            monkeypatch.setenv("OPENAI_API_BASE", f"{server.url}/v1")
        assert_works(path, folder)


def assert_works(path: Path, folder: Path) -> None:
    for block in BLOCKS[path]:
        if block.not_run is None and block.language in (*SHELL, "python"):
            done = run(block, folder)
            assert done.returncode == 0, f"{block.page}:{block.line}\n{block.commands}\n{done.stdout}{done.stderr}"
            assert_looks_as_shown(block, done.stdout)


def run(block: Block, folder: Path) -> subprocess.CompletedProcess[str]:
    programs = prepared.programs()
    program = [programs / "python"] if block.language == "python" else ["bash", "-e", "-o", "pipefail"]
    path = os.pathsep.join([str(programs), str(Path(sys.executable).parent), os.environ["PATH"]])
    # A page is read on a wide terminal; a few crashes are done before workers of their own would have started.
    environment = os.environ | {"PATH": path, "COLUMNS": "200", "TRACE_DAG_EXECUTION__WORKERS": "1"}
    environment["PYTHONPATH"] = str(Path(__file__).parents[2])  # for the laboratory, which is not installed
    return subprocess.run(
        program, input=block.commands, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def assert_looks_as_shown(block: Block, printed: str) -> None:
    """A page that shows a table shows the columns which the command prints."""
    if block.language != "console":
        return
    shown = [line for line in block.text.splitlines() if line and not line.startswith(("$ ", "─"))]
    heads = [line.split() for line, below in zip(shown, block.text.splitlines()[2:], strict=False) if "──" in below]
    for head in heads:
        assert any(line.split() == head for line in printed.splitlines()), f"{block.page}:{block.line}: {head}"


@pytest.mark.parametrize(
    "block",
    [block for found in BLOCKS.values() for block in found if block.language in SHELL and block.not_run],
    ids=lambda block: f"{block.page}:{block.line}",
)
def test_commands_that_cannot_run_here_are_valid(block: Block, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    checked = subprocess.run(["bash", "-n"], input=block.commands, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stderr
    monkeypatch.chdir(tmp_path)
    (tmp_path / "published").mkdir()  # a folder that has to be there for a command to be taken
    for line in block.commands.splitlines():
        words = shlex.split(line, comments=True)
        if any(word.endswith("trace-dag") for word in words):
            start = next(index for index, word in enumerate(words) if word.endswith("trace-dag"))
            taken_by(words[start + 1 :])


@pytest.mark.parametrize("path", PAGES, ids=[str(path.relative_to(REPOSITORY)) for path in PAGES])
def test_blocks_are_of_a_kind_that_is_checked(path: Path):
    for block in BLOCKS[path]:
        assert block.language in (*SHELL, "python", "toml", "yaml", "text", "mermaid"), (
            f"{block.page}:{block.line}: {block.language!r}"
        )
        if block.language == "toml":
            tomllib.loads(block.text)
        if block.language == "yaml":
            yaml.safe_load(block.text)


@pytest.mark.parametrize("path", PAGES, ids=[str(path.relative_to(REPOSITORY)) for path in PAGES])
def test_tables_and_lists_are_shown_as_such(path: Path):
    # GitHub begins a table or list right below a line of text; the site's Markdown goes on with the text.
    html = markdown.markdown(path.read_text(), extensions=["tables", "pymdownx.superfences", "md_in_html"])
    paragraphs = re.findall(r"<p>(.*?)</p>", html, re.DOTALL)
    assert [each[:80] for each in paragraphs if re.search(r"^(\||[-*] |\d+\. )", each, re.MULTILINE)] == []


EXPLANATIONS = sorted((REPOSITORY / "docs" / "explanation").glob("*.md"))


@pytest.mark.parametrize("path", EXPLANATIONS, ids=lambda path: path.stem)
def test_explanations_have_at_most_900_words(path: Path):
    assert len(path.read_text().split()) <= 900, "move tables and measurements to docs/reference"

"""Every setting as it stands, and plug-ins of installed packages: ``settings`` and ``plugins``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from trace_dag.cli.options import examples
from trace_dag.cli.printing import print_table, write_json
from trace_dag.common.errors import UserError

if TYPE_CHECKING:
    from trace_dag.common.settings_sources import DescribedSetting


@click.command(epilog=examples("trace-dag settings", "trace-dag settings sim --json"))
@click.argument("section", required=False)
@click.option("--json", "as_json", is_flag=True, help="The same as JSON.")
@click.pass_obj
def settings(root: str, section: str | None, as_json: bool) -> None:
    """List every setting with its value, default, meaning and source.

    The names carry the units: _m metres, _s seconds, _mps metres a second, _deg degrees, _h clock positions. Set one in
    ROOT/settings.toml, or in the environment: TRACE_DAG_SIM__STEP_S=0.002.
    """
    from trace_dag.flow.workspace import settings_of

    rows = [each for each in settings_of(root) if section in (None, each.section)]
    if not rows:
        raise UserError(f"settings {section}: there is no such section; trace-dag settings lists all of them")
    if as_json:
        write_json([each._asdict() for each in rows])
        return
    print_table(
        ["setting", "value", "default", "from", "meaning"],
        [
            (f"{each.section}.{each.name}", _said(each.value), _default(each), each.source, each.meaning)
            for each in rows
        ],
    )


def _default(setting: DescribedSetting) -> str:
    return "" if setting.value == setting.default else _said(setting.default)


def _said(value: object) -> str:
    return "null" if value is None else str(value)


@click.command(epilog=examples("trace-dag plugins"))
@click.option("--json", "as_json", is_flag=True, help="The same as JSON.")
def plugins(as_json: bool) -> None:
    """List the back-ends, converters, estimators, agents and sources that can be chosen by name.

    Any installed package can add some as entry points; see the documentation.
    """
    from trace_dag.common.plugins import PluginKind, list_plugins

    rows = [
        (kind.value.replace("_", " "), each.name, each.package, each.version, each.reference)
        for kind in PluginKind
        for each in list_plugins(kind).values()
    ]
    names = ["kind", "name", "package", "version", "what it is"]
    if as_json:
        write_json([dict(zip(("kind", "name", "package", "version", "reference"), row, strict=True)) for row in rows])
    else:
        print_table(names, rows)

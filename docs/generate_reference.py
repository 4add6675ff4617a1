"""MkDocs hook: the reference pages that are made from the code, so that they cannot differ from it.

Belongs here: which code a page is made of, and how it is laid out. Does not belong here: prose; that stands in the
pages themselves or in the docstrings, descriptions and comments these functions read.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib import resources
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from pydantic import BaseModel

from trace_dag.common.errors import Reason
from trace_dag.common.schemas import TableSchema
from trace_dag.common.settings import Settings
from trace_dag.common.stage import Stage
from trace_dag.crash.tables import CRASH_RECORD
from trace_dag.simulation.log_io import SIMULATION_STEPS

_COMMENT = re.compile(r"COMMENT ON (?P<kind>TABLE|VIEW|COLUMN) (?P<name>[\w.]+) IS '(?P<text>(?:[^']|'')*)'")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages to the site."""
    pages = {
        "reference/settings.md": settings_page(),
        "reference/tables.md": tables_page(),
        "reference/reasons.md": reasons_page(),
    }
    for path, content in pages.items():
        files.append(File.generated(config, path, content=content))
    return files


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Leave empty the default of a command's option that has none."""
    return html.replace("<code>Sentinel.UNSET</code>", "")


def settings_page() -> str:
    """Every setting, by section: name, default, what it means."""
    lines = [
        "# Settings",
        "",
        "In `ROOT/settings.toml`, one section per stage, or in the environment, which wins:",
        "`TRACE_DAG_SIM__FRICTION=0.4` is `friction = 0.4` in section `[sim]`. A changed setting makes the results of",
        "the stage it belongs to stale, and those of the stages after it. Names carry units.",
    ]
    for section, field in Settings.model_fields.items():
        model = field.annotation
        assert isinstance(model, type)
        assert issubclass(model, BaseModel)
        meaning = " ".join((model.__doc__ or "").split()).replace("``", "`")
        lines += ["", f"## {section}", "", meaning, "", "| setting | default | values | meaning |", "|---|---|---|---|"]
        for name, setting in model.model_fields.items():
            default = "" if setting.default is None else _cell(_default(setting))
            lines.append(f"| `{name}` | {default} | {_cell(_values(setting))} | {_cell(setting.description or '')} |")
    return "\n".join(lines) + "\n"


def _default(setting: Any) -> str:
    value = setting.get_default(call_default_factory=True)
    return f"`{value}`" if value not in ((), {}) else ""


def _values(setting: Any) -> str:
    options = re.findall(r"'([^']+)'", str(setting.annotation)) if "Literal" in str(setting.annotation) else []
    if options:
        return ", ".join(f"`{option}`" for option in options)
    bounds = []
    for rule in setting.metadata:
        for attribute, sign in (("ge", "≥"), ("gt", ">"), ("le", "≤"), ("lt", "<")):
            if hasattr(rule, attribute):
                bounds.append(f"{sign} {getattr(rule, attribute)}")
    return ", ".join(bounds)


def tables_page() -> str:
    """Every table and view of the warehouse with the comments of its columns, then the stored Parquet tables."""
    lines = [
        "# Tables and columns",
        "",
        "Tables and views of `ROOT/warehouse.duckdb`, for `trace-dag sql`; each is a file in",
        "`trace_dag/warehouse/sql/`. The same comments are in the database: `SELECT * FROM duckdb_columns()`.",
    ]
    for name, meaning, columns in warehouse_tables():
        lines += ["", f"## {name}", "", f"{meaning}.", "", "| column | meaning |", "|---|---|"]
        lines += [f"| `{column}` | {_cell(text)} |" for column, text in columns]
    for kind, schema in (("JSON", CRASH_RECORD), ("Parquet", SIMULATION_STEPS)):
        lines += ["", f"## {kind}: {schema.name}", "", schema.meaning, ""]
        lines += ["| column | type | unit | meaning | FARS element |", "|---|---|---|---|---|"]
        lines += _dictionary(schema)
    return "\n".join(lines) + "\n"


def warehouse_tables() -> Iterator[tuple[str, str, list[tuple[str, str]]]]:
    """Name, meaning and commented columns of every table and view, by name."""
    folder = resources.files("trace_dag.warehouse") / "sql"
    for file in sorted((each for each in folder.iterdir() if each.name.endswith(".sql")), key=lambda each: each.name):
        meaning, columns = "", []
        for found in _COMMENT.finditer(file.read_text("utf-8")):
            text = found["text"].replace("''", "'")
            if found["kind"] == "COLUMN":
                columns.append((found["name"].partition(".")[2], text))
            else:
                meaning = text
        yield file.name.removesuffix(".sql"), meaning, columns


def _dictionary(schema: TableSchema) -> Iterator[str]:
    for row in schema.dictionary():
        yield (
            f"| `{row['column']}` | {row['type']} | {row['unit']} | {_cell(row['meaning'])} | {_cell(row['source'])} |"
        )


def reasons_page() -> str:
    """Every reason for a rejection, by stage."""
    lines = [
        "# Reasons for a rejection",
        "",
        "A rejected crash was examined and is left out for one of these reasons. Its record, `trace-dag status --json`",
        "and the table `crashes` give the sentence with the measured value. The last column is the category of the",
        "published study, so that the funnels can be set side by side.",
        "",
        "| stage | reason | what it means | what to do | published category |",
        "|---|---|---|---|---|",
    ]
    for stage in Stage:
        for reason in Reason:
            if reason.stage is stage:
                lines.append(
                    f"| `{stage}` | `{reason}` | {_cell(reason.meaning)} | {_cell(reason.remedy)} "
                    f"| {reason.published_category} |"
                )
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")

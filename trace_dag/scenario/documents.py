"""The documents beside scenarios, in words: templates of Markdown and the like, filled in."""

from __future__ import annotations

from importlib import resources
from typing import Any


def render_document(template: str, **values: Any) -> bytes:
    """A template of ours, filled in, UTF-8. A value that a template wants and does not get is an error."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True, autoescape=False)  # noqa: S701 - Markdown
    environment.filters["words"] = lambda value: str(value).replace("_", " ")
    text = resources.files("trace_dag.scenario").joinpath("templates", template).read_text(encoding="utf-8")
    return environment.from_string(text).render(**values).encode()

"""The documents beside scenarios, in words: templates of Markdown and the like, filled in."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment


def render_document(template: str, **values: Any) -> bytes:
    """A template of ours, filled in, UTF-8. A value that a template wants and does not get is an error."""
    return _templates().get_template(template).render(**values).encode()


@cache
def _templates() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("trace_dag.scenario", "templates"),
        undefined=StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,  # noqa: S701 - Markdown
    )
    environment.filters["words"] = lambda value: str(value).replace("_", " ")
    return environment

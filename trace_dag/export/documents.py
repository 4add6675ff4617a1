"""Text documents of packages: templates of Markdown and the like, filled in.

Values are escaped for Markdown; ``| code`` makes a value inline code.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from trace_dag.common.messages.markdown import code_span, escape
from trace_dag.common.messages.wording import count_of

if TYPE_CHECKING:
    from jinja2 import Environment


class _Markdown(str):
    """Text that is Markdown already."""

    __slots__ = ()


def render_document(template: str, **values: Any) -> bytes:
    """Return a template of this package, filled in, as UTF-8.

    A missing value is an error.
    """
    markdown = template.endswith(".md.jinja")
    return _templates(markdown=markdown).get_template(template).render(**values).encode()


def _shown(value: object) -> object:
    return escape(value) if isinstance(value, str) and not isinstance(value, _Markdown) else value


@cache
def _templates(*, markdown: bool) -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("trace_dag.export", "templates"),
        undefined=StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,  # noqa: S701 - no HTML
        finalize=_shown if markdown else None,
    )
    environment.filters["code"] = lambda value: _Markdown(code_span(str(value)))
    environment.filters["counted"] = count_of
    environment.filters["words"] = lambda value: str(value).replace("_", " ")
    return environment

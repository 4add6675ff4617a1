"""Text from outside as Markdown shows it: as it was written, and never as markup, a link or HTML.

Belongs here: escaping for CommonMark with GitHub's tables (https://spec.commonmark.org, https://github.github.com/gfm).
HTML is escaped by the templates' engine, XML by its writers.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

# Controls and what turns the direction of writing: they change how the text around them is read.
_UNSEEN = re.compile("[\x00-\x1f\x7f-\x9f\u200e\u200f\u2028\u2029\u202a-\u202e\u2066-\u2069]+")
# An underscore within a word is one; a "#" begins a heading only where a line begins.
_MARKUP = re.compile(r"[\\`*\[\]|~$]|(?<![^\W_])_|_(?![^\W_])|^#")
_TICKS = re.compile("`+")


def escape(text: str) -> str:
    """Return ``text`` as one escaped line for a paragraph or a table's cell.

    >>> escape('<b>MAIN</b> ST')
    '&lt;b&gt;MAIN&lt;/b&gt; ST'
    """
    line = " ".join(_UNSEEN.sub(" ", text).split(" "))
    line = re.sub(r"&(?=#|\w+;)", "&amp;", line).replace("<", "&lt;").replace(">", "&gt;")
    return _MARKUP.sub(lambda found: f"\\{found[0]}", line)


def code_span(text: str) -> str:
    """Return ``text`` as inline code, with a fence longer than any ticks in it.

    >>> code_span('a`b')
    '``a`b``'
    """
    line = _UNSEEN.sub(" ", text)
    fence = "`" * (max(map(len, _TICKS.findall(line)), default=0) + 1)
    room = " " if line[:1] in ("", "`") or line[-1:] == "`" else ""
    return f"{fence}{room}{line}{room}{fence}"


def code_block(text: str) -> str:
    """Return ``text`` as a block of code, line by line.

    >>> print(code_block('trace-dag run'))
    ```
    trace-dag run
    ```
    """
    fence = "`" * max(3, max(map(len, _TICKS.findall(text)), default=0) + 1)
    return f"{fence}\n{text}\n{fence}"


def table(names: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return rows as a Markdown table, with empty cells for None.

    >>> print(table(["road", "lanes"], [["Main St", 4], ["Elder St", None]]))
    | road | lanes |
    | --- | --- |
    | Main St | 4 |
    | Elder St |  |
    """
    lines = [" | ".join(map(escape, names)), " | ".join("---" for _ in names)]
    lines += [" | ".join("" if value is None else escape(str(value)) for value in row) for row in rows]
    return "\n".join(f"| {line} |" for line in lines)

"""Text from outside in Markdown, read back by a renderer of CommonMark that lets HTML through."""

from __future__ import annotations

import html
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from trace_dag.common.messages.markdown import code_block, code_span, escape, table

RENDERER = MarkdownIt("commonmark", {"html": True}).enable("table").enable("strikethrough")
HOSTILE = (
    "<script>alert(1)</script>",
    "[see](javascript:alert(1))",
    "![x](http://example.org/seen.png)",
    "<!-- swallows the rest",
    "&lt;b&gt; &amp; AT&T",
    "a | b || c",
    "# no heading",
    "**bold** _it_ ~~gone~~ `code` ``more``",
    "snake_case_name and _this_",
    "one\n\n# two\r\n- three\u2028four",
    "\\[x\\](y) \\",
    "$\\frac{1}{2}$ ${alert(1)}",
    "[x]: http://example.org",
    "seen\u202eneve",
)
TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=60)


def said(markdown: str) -> str:
    """What a reader sees, without its markup; fails if there is any but paragraphs."""
    rendered = RENDERER.render(f"before {markdown} after")
    assert set(re.findall(r"</?(\w+)", rendered)) == {"p"}, rendered
    shown = html.unescape(re.sub(r"<[^>]+>", "", rendered)).strip()
    return shown.removeprefix("before ").removesuffix(" after")


def plain(text: str) -> str:
    """The text in one line, without controls and marks that turn the direction of writing."""
    unseen = "[\x00-\x1f\x7f-\x9f\u200e\u200f\u2028\u2029\u202a-\u202e\u2066-\u2069]+"
    return re.sub(unseen, " ", text)


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_text_is_shown_as_written(text: str):
    assert said(escape(text)) == plain(text)


@given(TEXT)
def test_any_text_is_shown_as_written(text: str):
    assert said(f"x{escape(text)}x") == f"x{plain(text)}x"


@given(TEXT)
def test_code_is_shown_as_written(text: str):
    rendered = RENDERER.render(f"before {code_span(text)} after")
    assert set(re.findall(r"</?(\w+)", rendered)) == {"p", "code"}, rendered
    shown = html.unescape(re.search(r"<code>(.*)</code>", rendered, re.DOTALL)[1])
    assert shown.strip() == plain(text).strip()


def test_a_block_of_code_ends_where_it_ends():
    rendered = RENDERER.render(code_block("````\n<b>\n```") + "\nafter")
    assert rendered == "<pre><code>````\n&lt;b&gt;\n```\n</code></pre>\n<p>after</p>\n"


@pytest.mark.parametrize("text", HOSTILE)
def test_a_table_keeps_its_shape(text: str):
    rendered = RENDERER.render(table(["one", text], [(text, None), (1, 2)]))
    assert rendered.count("<tr>") == 3
    assert rendered.count("<th>") == 2
    assert rendered.count("<td>") == 4
    assert set(re.findall(r"</?(\w+)", rendered)) == {"table", "thead", "tbody", "tr", "th", "td"}

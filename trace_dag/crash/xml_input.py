"""XML from outside, read without trusting it: no entity is expanded, nothing is fetched, size and depth are bounded.

No report needs a document type, so a file with one is refused before it is parsed (billion laughs, external entities).
Markup that is only badly escaped (a bare ``&`` in a label, as the CrashAPI really serves) can be repaired, if the
caller wants that; the record is then marked.
"""

from __future__ import annotations

import re
from typing import Final

from lxml import etree

from trace_dag.common.errors import Reason, Rejection
from trace_dag.crash.fields import Row

MAX_REPORT_BYTES: Final = 16 * 1024 * 1024
"""The largest real report seen has 140 kB; a crash of a hundred vehicles would have about 5 MB."""

MAX_MARKUP: Final = 500_000
"""Tags and attributes together: the parsed tree takes about 120 bytes for each. Real reports have some thousands."""

_BARE_AMPERSAND: Final = re.compile(rb"&(?!(?:[A-Za-z][A-Za-z0-9]*|#[0-9]+|#x[0-9A-Fa-f]+);)")
_BARE_LESS_THAN: Final = re.compile(rb"<(?![A-Za-z_/!?])")
_FORBIDDEN_CONTROL: Final = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f]")
_DOCTYPE: Final = re.compile(rb"<!\s*(?:DOCTYPE|ENTITY)", re.IGNORECASE)
_REMEDY: Final = "fetch the report again, or set crash.repair_malformed to have badly escaped characters repaired"


def parse_untrusted(data: bytes, *, name: str, repair: bool = False) -> tuple[etree._Element, bool]:
    """Return the root element, and whether the text had to be repaired.

    Raises :class:`Rejection` (``malformed_report``) that names ``name``, line and column.

    >>> parse_untrusted(b"<ROAD>Main & Elm</ROAD>", name="crash.xml", repair=True)[0].text
    'Main & Elm'
    """
    _check_harmless(data, name=name)
    try:
        return etree.fromstring(data, _parser()), False
    except etree.XMLSyntaxError as error:
        if repair:
            try:
                return etree.fromstring(_repaired(data), _parser()), True
            except etree.XMLSyntaxError as still:
                raise _malformed(still, name, "the file cannot be repaired; fetch it again") from still
        raise _malformed(error, name, _REMEDY) from error


def parse_leniently(data: bytes, *, name: str) -> etree._Element | None:
    """Parse as much as possible of a file that may not be well-formed; return None if nothing can be read.

    >>> parse_leniently(b"<ROAD>Main", name="crash.xml").text
    'Main'
    """
    _check_harmless(data, name=name)
    try:
        return etree.fromstring(data, _parser(recover=True))
    except etree.XMLSyntaxError:
        return None


def local_name(element: etree._Element) -> str:
    """Return the element's name without its namespace, which lxml writes before it in braces.

    >>> local_name(etree.fromstring('<Count xmlns="http://example.org">1</Count>'))
    'Count'
    """
    return element.tag.rpartition("}")[2]


def values_of(element: etree._Element) -> Row:
    """Return the non-blank texts of an element's children that have no children themselves.

    >>> values_of(etree.fromstring("<Vehicle><VEH_NO>1</VEH_NO><Persons><Person/></Persons></Vehicle>"))
    {'VEH_NO': '1'}
    """
    row: Row = {}
    for child in element:
        if isinstance(child.tag, str) and len(child) == 0 and (text := (child.text or "").strip()):
            row.setdefault(local_name(child).upper(), text)
    return row


def _check_harmless(data: bytes, *, name: str) -> None:
    """Raise :class:`Rejection` for files with a document type, or with too much data or markup for a report."""
    if len(data) > MAX_REPORT_BYTES:
        raise Rejection(
            Reason.MALFORMED_REPORT,
            f"{name} has {len(data) / 1e6:.1f} MB; a report has at most {MAX_REPORT_BYTES / 1e6:.1f} MB",
            measured=len(data) / 1e6,
            threshold=MAX_REPORT_BYTES / 1e6,
        )
    markup = data.count(b"<") + data.count(b"=")
    if markup > MAX_MARKUP:
        raise Rejection(
            Reason.MALFORMED_REPORT,
            f"{name} has {markup} tags and attributes; a report has at most {MAX_MARKUP}",
            measured=markup,
            threshold=MAX_MARKUP,
        )
    # NUL bytes are dropped so that UTF-16 and UTF-32 hide nothing.
    found = _DOCTYPE.search(data.replace(b"\0", b""))
    if found:
        raise Rejection(
            Reason.MALFORMED_REPORT,
            f"{name} declares a document type or an entity ({found.group().decode()}), which no report does; "
            "it is not read",
        )


def _parser(*, recover: bool = False) -> etree.XMLParser:
    return etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        dtd_validation=False,
        huge_tree=False,
        recover=recover,
        remove_comments=True,
        remove_pis=True,
    )


def _repaired(data: bytes) -> bytes:
    data = _FORBIDDEN_CONTROL.sub(b"", data)
    return _BARE_LESS_THAN.sub(b"&lt;", _BARE_AMPERSAND.sub(b"&amp;", data))


def _malformed(error: etree.XMLSyntaxError, name: str, remedy: str) -> Rejection:
    line, column = error.position
    what = re.sub(r", line \d+, column \d+.*", "", error.msg or "no XML")
    return Rejection(
        Reason.MALFORMED_REPORT, f"{name} is not well-formed XML at line {line}, column {column}: {what}; {remedy}"
    )

"""Templates of all pages, and the formats of values in them.

Makes and models are plain names, from the labels of FARS. A label has notes for coders: model years of the code, codes
of other years, and asterisks for footnotes. Records and tables keep labels as they are; texts for people have names.
"""

from __future__ import annotations

import base64
import gzip
import re
from functools import cache
from typing import TYPE_CHECKING, Any, Final

from trace_dag.common.units import mps_to_mph
from trace_dag.crash.codes.elements import SOE
from trace_dag.crash.parties import party_in_words, party_label, thing_party
from trace_dag.crash.summary import TOPOLOGIES, place_in_words
from trace_dag.version import __version__

if TYPE_CHECKING:
    from jinja2 import Environment

NAMES = {**{topology.value: name for topology, name in TOPOLOGIES.items()}, "suv": "SUV", "others": "other"}
"""Values of the warehouse that pages call otherwise than by their words."""
_NOTE: Final = re.compile(r"\([^()]*\)")
_NEITHER_KNOWN: Final = "Unknown Make"
_FOOTNOTE: Final = re.compile(r"\*+:?")


def words(value: object) -> str:
    """Return ``"two_vehicles"`` as ``"two vehicles"``, ``"t"`` as ``"T junction"``.

    >>> words('two_vehicles'), words('t')
    ('two vehicles', 'T junction')
    """
    return NAMES.get(str(value), str(value).replace("_", " ")) if value else ""


def _party(number: int | None) -> str:
    """Return ``V2``, ``P1`` or ``the object of event 3``: a party's name in tables and pictures."""
    if number is None:
        return "–"
    return party_label(number) if number < thing_party(0) else party_in_words(number)


def _fixed(value: float | None, digits: int = 2) -> str:
    return "–" if value is None else f"{round(value, digits) + 0.0:.{digits}f}"  # no minus before a zero


def _holds(passed: bool | None, threshold: float | None) -> str:
    if passed is None:
        return "reported only" if threshold is None else "not evaluated"
    return "yes" if passed else "no"


def render(template: str, **values: Any) -> bytes:
    """Return a page: a template filled in. All text is escaped, since reports and maps are not trusted.

    >>> b"&lt;b&gt;" in render("replay_pair.html.jinja", title="<b>", place="", sides=[], hit="null", end=1.0)
    True
    """
    return _templates().get_template(template).render(version=__version__, **values).encode()


@cache
def _templates() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("trace_dag.pages", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["words"] = lambda value: words(value) or "–"
    environment.filters["holds"] = _holds
    environment.filters["party"] = _party
    environment.filters["place"] = place_in_words
    environment.filters["vehicle_name"] = vehicle_name
    environment.filters["event"] = SOE.meaning
    environment.filters["mph"] = lambda mps: "–" if mps is None else f"{mps_to_mph(mps):.0f} mph"
    environment.filters["fixed"] = _fixed
    environment.filters["percent"] = lambda value: "–" if value is None else f"{100 * value:.0f} %"
    environment.filters["unit"] = lambda unit: "m/s" if unit == "mps" else unit
    environment.filters["kilobytes"] = lambda size: f"{max(1, round(size / 1024)):,} kB"
    return environment


def compress(data: bytes) -> bytes:
    """Compress large content of pages with gzip.

    The same data gives the same bytes.

    >>> import gzip
    >>> gzip.decompress(compress(b"a log"))
    b'a log'
    """
    return gzip.compress(data, 6, mtime=0)


def encode_base64(data: bytes) -> str:
    """Return bytes in base64 for a page, whose script (``bytes_of_base64`` in ``templates/unzipped.js``) decodes them.

    >>> encode_base64(b"a log")
    'YSBsb2c='
    """
    return base64.b64encode(data).decode()


def read(name: str) -> str:
    """Return a file of the folder of templates, unchanged."""
    from importlib import resources

    return resources.files("trace_dag.pages").joinpath("templates", name).read_text(encoding="utf-8")


# --- names of vehicles -----------------------------------------------------------------------------------------------
def vehicle_name(label: str) -> str:
    """Return the name in a label of make and model (``MAK_MODNAME``), without notes and marks of footnotes.

    Empty if the label is that of unknown values.

    >>> vehicle_name("Mercury Marquis/Monterey (car version; for van version 2004 on see code 444) /Grand Marquis")
    'Mercury Marquis/Monterey/Grand Marquis'
    >>> vehicle_name("Subaru Outback (2003 on)(see 034 for prior to 2003)")
    'Subaru Outback'
    >>> vehicle_name("Unknown Make Unknown (as to automobile, motored cycle, light truck or truck)")
    ''
    """
    if label.startswith(_NEITHER_KNOWN):
        return ""
    name = _FOOTNOTE.sub(" ", _NOTE.sub(" ", label))
    return re.sub(r"\s*/\s*", "/", " ".join(name.split()))

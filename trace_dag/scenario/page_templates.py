"""What all pages share: the templates of HTML, and how values are written in them."""

from __future__ import annotations

import base64
import math
from functools import cache
from typing import TYPE_CHECKING, Final

import deflate
import numpy as np

from trace_dag.crash.codes.events import SOE
from trace_dag.crash.parties import party_in_words, party_label, thing_party
from trace_dag.crash.summary import place_in_words
from trace_dag.scenario.vehicle_names import vehicle_name
from trace_dag.units import mps_to_mph

if TYPE_CHECKING:
    from jinja2 import Environment

_FIRST_LETTER: Final = 0x4E00  # from here on 2 ** 15 letters are all single and have no meaning for JavaScript


def words(value: object) -> str:
    """``"two_vehicles"`` as ``"two vehicles"``.

    >>> words('two_vehicles')
    'two vehicles'
    """
    return str(value).replace("_", " ") if value else ""


def _party(number: int | None) -> str:
    """``V2``, ``P1``, ``what event 3 struck``: a party as tables and pictures name it."""
    if number is None:
        return "–"
    return party_label(number) if number < thing_party(0) else party_in_words(number)


def _fixed(value: float | None, digits: int = 2) -> str:
    return "–" if value is None else f"{round(value, digits) + 0.0:.{digits}f}"  # no minus before a zero


def _holds(passed: bool | None, threshold: float | None) -> str:
    if passed is None:
        return "reported only" if threshold is None else "not evaluated"
    return "yes" if passed else "no"


@cache
def templates() -> Environment:
    """The environment of all pages. It escapes everything: reports and maps are not trusted.

    >>> templates().from_string("{{ name }}").render(name="<b>")  # nothing of a report is taken for HTML
    '&lt;b&gt;'
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("trace_dag.scenario", "templates"),
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


def zipped(data: bytes) -> bytes:
    """What pages hold is large, as gzip. The same data gives the same bytes.

    >>> import gzip
    >>> gzip.decompress(zipped(b"a log"))
    b'a log'
    """
    return bytes(deflate.gzip_compress(data, 8))


def in_base64(data: bytes) -> str:
    """Bytes as a page holds them: ``bytes_of_base64`` of its script (``templates/unzipped.js``) makes them again.

    >>> in_base64(b"a log")
    'YSBsb2c='
    """
    return base64.b64encode(data).decode()


def in_letters(data: bytes) -> str:
    """Bytes as a script of its own holds them, in UTF-16: 15 bits to a letter, from U+4E00 on, after a letter that says
    how many bytes (0 or 1) to leave out at the end. A fifteenth is added so, where base64 adds a third.

    ``bytes_of_letters`` of a page's script makes them again.

    >>> [ord(letter) - 0x4E00 for letter in in_letters(bytes([0b10000000, 0b00000011]))]
    [1, 16385, 16384]
    """
    count = math.ceil(8 * len(data) / 15)
    bits = np.zeros(15 * count, np.uint8)
    bits[: 8 * len(data)] = np.unpackbits(np.frombuffer(data, np.uint8))
    values = np.packbits(np.pad(bits.reshape(count, 15), ((0, 0), (1, 0))), axis=1).view(">u2")
    needless = 15 * count // 8 - len(data)
    return (_FIRST_LETTER + np.append(needless, values)).astype("<u2").tobytes().decode("utf-16-le")


def read(name: str) -> str:
    """A file of the folder of templates as it is."""
    from importlib import resources

    return resources.files("trace_dag.scenario").joinpath("templates", name).read_text(encoding="utf-8")

"""Attribution and licence of maps, and whether they show a real place.

An XML file states it on its root element; data of OpenStreetMap are attributed as its licence requires. A map that
calls itself fictional belongs to invented crashes, and everything that shows them has to say so.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

OSM_ATTRIBUTION: Final = "© OpenStreetMap contributors, ODbL 1.0"
"""The credit that https://www.openstreetmap.org/copyright asks for: of a map that says nothing else."""

_SPDX: Final = {"odbl": "ODbL-1.0", "openstreetmap": "ODbL-1.0", "cc0": "CC0-1.0"}
_UNKNOWN: Final = "NOASSERTION"  # SPDX 2.3, section 8.5: nobody has said which licence it is


def read_attribution(root: Mapping[str, str]) -> str:
    """Read a map's attribution from the attributes of its ``<osm>`` element.

    It is ``attribution`` if that is text, else ``copyright`` with ``license``. Servers of OpenStreetMap put addresses
    there (``attribution="http://www.openstreetmap.org/copyright"``); for them, and for a file without these attributes,
    it is :data:`OSM_ATTRIBUTION`.

    >>> read_attribution({"copyright": "City of Lincoln", "license": "CC0"})
    'City of Lincoln, CC0'
    """
    attribution = root.get("attribution", "").strip()
    if attribution and "://" not in attribution:
        return attribution
    said = [text for name in ("copyright", "license") if (text := root.get(name, "").strip())] or [attribution]
    words = ", ".join(filter(None, said))
    return OSM_ATTRIBUTION if not words or "openstreetmap" in f"{words} {attribution}".lower() else words


@dataclass(frozen=True)
class Rights:
    """The rights in some maps and in works made of them.

    ``attributions``: each once, in order.
    """

    attributions: tuple[str, ...]

    @classmethod
    def of(cls, attributions: Iterable[str]) -> Rights:
        """Return the rights of maps with these attributions."""
        return cls(tuple(sorted(set(attributions))))

    @property
    def fictional(self) -> bool:
        """Return whether all the maps show places that do not exist."""
        return bool(self.attributions) and all("fictional" in each.lower() for each in self.attributions)

    @property
    def openstreetmap(self) -> bool:
        """Return whether OpenStreetMap is the source of any map."""
        return any(_licence(each) == "ODbL-1.0" for each in self.attributions)

    @property
    def licence(self) -> str:
        """Return the SPDX licence expression for all maps together."""
        return " AND ".join(sorted({_licence(each) for each in self.attributions})) or _UNKNOWN


def _licence(attribution: str) -> str:
    return next((name for word, name in _SPDX.items() if word in attribution.lower()), _UNKNOWN)

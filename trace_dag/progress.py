"""How work that takes its time says how far it is; who shows it is :mod:`trace_dag.cli.progress`'s."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

Progress = Callable[[int, int], None]
"""Hears how many of how many are done."""


def silent(_done: int, _total: int) -> None:
    """The progress of work that nobody watches."""


@dataclass(frozen=True)
class MapProgress:
    """How far a large map file is read, bytes, and how many of the sites asked for were found in it so far."""

    file: str
    read: int
    size: int
    sites: int = 0
    found: int = 0

    def in_words(self) -> str:
        """A line for a log.

        >>> MapProgress("virginia.osm.pbf", 512_000_000, 1_100_000_000, 3000, 1250).in_words()
        'virginia.osm.pbf: 512 of 1,100 MB read, 1,250 of 3,000 sites found'
        """
        sites = f", {self.found:,} of {self.sites:,} sites found" if self.sites else ""
        return f"{self.file}: {self.read / 1e6:,.0f} of {self.size / 1e6:,.0f} MB read{sites}"


MapListener = Callable[[MapProgress], None]
"""Hears how far a large map file is read."""


def unheard(_progress: MapProgress) -> None:
    """The listener where nobody watches."""

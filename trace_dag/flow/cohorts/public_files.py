"""The two public files that a state and a year need: NHTSA's tables and Geofabrik's map, found where they lie.

Belongs here: the names of the files, their addresses, and the folders to search. Does not belong here: reading them
(:mod:`trace_dag.crash.fars.files`, :mod:`trace_dag.osm`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Final

from trace_dag.common.errors import UserError
from trace_dag.crash.codes.elements import STATES
from trace_dag.crash.keys import fars_case, state_of

if TYPE_CHECKING:
    from trace_dag.flow.cohorts.choice import Choice

FARS_URL: Final = "https://static.nhtsa.gov/nhtsa/downloads/FARS/{year}/National/FARS{year}NationalCSV.zip"
GEOFABRIK_URL: Final = "https://download.geofabrik.de/north-america/us/{state}-latest.osm.pbf"


@dataclass(frozen=True)
class PublicFile:
    """A file to have: ``patterns`` are its usual names, the published one first; ``what`` describes its content."""

    what: str
    url: str
    patterns: tuple[str, ...]

    @property
    def name(self) -> str:
        """Return its published name."""
        return self.url.rpartition("/")[2]

    def found(self, folders: Iterable[Path]) -> Path | None:
        """Return the newest matching file of the first folder that has one."""
        for folder in folders:
            files = [path for pattern in self.patterns for path in _matching(folder, pattern)]
            if files:
                return max(files, key=lambda path: (path.stat().st_mtime, path.name))
        return None


def _matching(folder: Path, pattern: str) -> Iterator[Path]:
    pattern = pattern.lower()
    return (path for path in folder.iterdir() if fnmatchcase(path.name.lower(), pattern) and path.is_file())


def tables_of(year: int) -> PublicFile:
    """Return the national tables of a year.

    >>> tables_of(2023).name
    'FARS2023NationalCSV.zip'
    """
    url = FARS_URL.format(year=year)
    return PublicFile(f"NHTSA's tables of {year}", url, (f"FARS{year}NationalCSV*.zip",))


def map_of(state: int) -> PublicFile:
    """Return the map of a state, by its code.

    >>> map_of(51).name
    'virginia-latest.osm.pbf'
    """
    slug = STATES[state].lower().replace(" ", "-")
    return PublicFile(f"the map of {STATES[state]}", GEOFABRIK_URL.format(state=slug), (f"{slug}-[0-9l]*.osm.pbf",))


def files_of(choice: Choice) -> list[PublicFile]:
    """Return the files that the states and years of a choice, or its named cases, need.

    Raises UserError if the choice has neither.

    >>> from trace_dag.flow.cohorts.choice import Choice
    >>> [each.name for each in files_of(Choice(cases=frozenset({"2023-510179"})))]
    ['FARS2023NationalCSV.zip', 'virginia-latest.osm.pbf']
    """
    named = [fars_case(key) for key in choice.cases]
    years = choice.wanted.years or {year for year, _ in named}
    states = choice.wanted.states or {state_of(case) for _, case in named}
    if not years or not states:
        raise UserError(
            "ingest: say which state and year, such as trace-dag ingest --states Virginia --years 2023, and it says "
            "which two files that needs; or give files: --reports, --fars-csv, --source, --crashapi, --maps"
        )
    return [*map(tables_of, sorted(years)), *map(map_of, sorted(states))]


def folders_to_look_in() -> list[Path]:
    """Return the working folder and that of the browser's downloads."""
    return [each for each in (Path.cwd(), Path.home() / "Downloads") if each.is_dir()]


def name_of(choice: Choice) -> str:
    """Return the cohort's name for a choice of states and years, or cases.

    >>> from trace_dag.flow.cohorts.choice import Choice
    >>> name_of(Choice(cases=frozenset({"2023-510179"})))
    'virginia-2023'
    """
    names: Sequence[str] = [each.name for each in files_of(choice)]
    states = [name.partition("-latest")[0] for name in names if name.endswith(".pbf")]
    years = [name[4:8] for name in names if name.endswith(".zip")]
    return "-".join([*states, *years])

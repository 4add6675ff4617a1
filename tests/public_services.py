"""The CrashAPI and Overpass on the loopback interface, answering from the bundled sample, well or unwell."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from loopback import Answer, Loopback, Request, serving

SAMPLE = Path(__file__).resolve().parents[1] / "data" / "sample"
MAP = SAMPLE / "osm" / "merrow.osm"
NEBRASKA = 31
VERIFIED = ("319003", "319022")
OFF_THE_MAP = "319067"
NOT_RELEASED = "319901"


@dataclass
class PublicServices:
    """What the services know, and which of it they do not give (503): cases by number, or "map".

    The reports of ``withheld`` cases are listed but not released.
    """

    cases: tuple[str, ...] = (*VERIFIED, NOT_RELEASED)
    down: set[str] = field(default_factory=set)
    withheld: set[str] = field(default_factory=set)
    server: Loopback | None = None

    def respond(self, request: Request, _: int) -> Answer:
        if request.path.endswith("/GetCaseList"):
            assert request.query["states"] == str(NEBRASKA)
            assert (request.query["minNumOfVehicles"], request.query["maxNumOfVehicles"]) == ("2", "2")
            cases = [{"St_Case": int(case), "State": NEBRASKA, "CountyName": "MERROW (1)"} for case in self.cases]
            return Answer(json.dumps({"Count": 1, "Results": [cases]}).encode())
        if request.path.endswith("/GetCaseDetails"):
            case = request.query["stateCase"]
            path = SAMPLE / "reports" / f"crash_{case}.xml"
            if case in self.down:
                return Answer(status=503)
            released = path.is_file() and case not in self.withheld
            return Answer(path.read_bytes() if released else not_released(case))
        if request.path in ("/overpass", "/osm/map"):
            return Answer(status=503) if "map" in self.down else Answer(MAP.read_bytes())
        return Answer(status=404)

    @property
    def settings(self) -> dict[str, object]:
        """The settings by which they are reached, without patience."""
        assert self.server is not None
        return {
            "crashapi_url": f"{self.server.url}/CrashAPI",
            "overpass_urls": (f"{self.server.url}/overpass",),
            "osm_api_url": f"{self.server.url}/osm",
            "requests_per_s": 1000,
            "attempts": 2,
            "first_wait_s": 0,
        }

    def asked(self, ending: str = "") -> int:
        """How many requests there were for a path that ends like that."""
        assert self.server is not None
        return sum(request.path.endswith(ending) for request in self.server.requests)


def not_released(case: str) -> bytes:
    return (
        "<ResponseOfListOfCaseDetail><Count>0</Count><Message>No results found</Message><SearchCriteria>StateCase: "
        f"{case} And CaseYear: 2023 And State: {NEBRASKA}</SearchCriteria><Results /></ResponseOfListOfCaseDetail>"
    ).encode()


@contextmanager
def public_services() -> Iterator[PublicServices]:
    """The services, as long as the context lasts."""
    made = PublicServices()
    with serving(made.respond) as server:
        made.server = server
        yield made

"""Roads of the town: a centre line (the line a mapper draws) and the lanes lying across it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from make.curves import Curve, corners, dense
from make.plane import FloatArray, plane_point, plane_points

# How closely mappers follow a curve.
MAPPED_SAGITTA_M = 0.05


@dataclass(frozen=True)
class CrossSection:
    """Lanes across a road and the OSM tags of that stretch.

    Widths in metres, from left to right looking along the way: lanes against the way, the shared centre lane, lanes
    along the way. ``way_left_m`` is how far left of the carriageway's middle the way is drawn (``placement``).
    """

    tags: dict[str, str]
    backward: tuple[float, ...] = ()
    centre: float = 0.0
    forward: tuple[float, ...] = ()
    way_left_m: float = 0.0

    @property
    def width_m(self) -> float:
        """Width of the carriageway."""
        return sum(self.backward) + self.centre + sum(self.forward)

    def lane(self, direction: int, index: int) -> tuple[float, float]:
        """Offset to the left of the way and width of a lane: ``direction`` +1 along the way, -1 against it;
        ``index`` from 1 at the left as its driver sees it; 0 is the shared centre lane."""
        left_edge = self.width_m / 2 - self.way_left_m
        if index == 0:
            return left_edge - sum(self.backward) - self.centre / 2, self.centre
        if direction > 0:
            before = sum(self.backward) + self.centre + sum(self.forward[: index - 1])
            return left_edge - before - self.forward[index - 1] / 2, self.forward[index - 1]
        before = sum(self.backward[: len(self.backward) - index])
        width = self.backward[len(self.backward) - index]
        return left_edge - before - width / 2, width

    def edges(self) -> tuple[float, float]:
        """Offsets to the left of the way of the carriageway's left and right edges."""
        return self.width_m / 2 - self.way_left_m, -self.width_m / 2 - self.way_left_m


def two_way(
    width_m: float, forward: int = 1, backward: int = 1, /, *, centre_m: float = 0.0, **tags: str
) -> CrossSection:
    """A road with traffic in both directions; tag keys are written with ``__`` for ``:``."""
    return CrossSection(
        {k.replace("__", ":"): v for k, v in tags.items()},
        (width_m,) * backward,
        centre_m,
        (width_m,) * forward,
    )


def one_way(width_m: float, count: int = 1, /, *, way_left_m: float = 0.0, **tags: str) -> CrossSection:
    """A one-way carriageway."""
    plain = {k.replace("__", ":"): v for k, v in tags.items()}
    return CrossSection({"oneway": "yes", **plain}, forward=(width_m,) * count, way_left_m=way_left_m)


@dataclass
class Road:
    """A named line on the map with its cross sections, each valid until a station (metres along the line)."""

    key: str
    common: dict[str, str]
    curve: Curve
    mapped: FloatArray  # vertices as a mapper draws them, shape (n, 2)
    sections: list[tuple[float, CrossSection]]
    trafficway: int = 1  # FARS VTRAFWAY
    reported_as: str = ""  # FARS TWAY_ID
    cuts: list[float] = field(default_factory=list)  # further stations at which the way is split
    closed: bool = False

    @classmethod
    def along(
        cls,
        key: str,
        plan: list[tuple[float, float]],
        sections: list[tuple[tuple[float, float] | None, CrossSection]],
        *,
        radii: dict[int, float] | None = None,
        trafficway: int = 1,
        reported_as: str = "",
        **common: str,
    ) -> Road:
        """A road through points of the plan, corners rounded by ``radii``; sections end at points of the plan."""
        points = plane_points(plan)
        curve = dense(corners(points, radii or {}))
        ends = [
            (math.inf if until is None else curve.station(plane_point(*until)), section) for until, section in sections
        ]
        tags = {k.replace("__", ":"): v for k, v in common.items()}
        mapped = corners(points, radii or {}, MAPPED_SAGITTA_M)
        return cls(key, tags, curve, mapped, ends, trafficway, reported_as or tags.get("name", "").upper())

    @classmethod
    def circle(
        cls, key: str, centre: tuple[float, float], radius_m: float, section: CrossSection, **common: str
    ) -> Road:
        """A closed ring driven counter-clockwise."""
        middle = plane_point(*centre)

        def ring(n: int) -> FloatArray:
            angles = np.linspace(0, math.tau, n + 1)
            return middle + radius_m * np.stack([np.cos(angles), np.sin(angles)], axis=1)

        mapped = ring(math.ceil(math.tau * radius_m / math.sqrt(8 * radius_m * MAPPED_SAGITTA_M)))
        return cls(key, dict(common), dense(ring(720)), mapped, [(math.inf, section)], 4, closed=True)

    def at(self, u_m: float, v_m: float) -> float:
        """Station nearest to a point of the plan."""
        return self.curve.station(plane_point(u_m, v_m))

    def section(self, s: float) -> CrossSection:
        """Cross section at a station."""
        return next(section for until, section in self.sections if s <= until)

    def room_beside(self, xy: FloatArray, course_rad: float, section: CrossSection) -> tuple[float, float]:
        """Distances from a point to the left and right edges of the carriageway, looking along ``course_rad``."""
        station = self.curve.station(xy)
        heading = self.curve.heading(station)
        across = np.array([-math.sin(heading), math.cos(heading)])
        left = float((xy - self.curve.point(station)) @ across)
        edge_left, edge_right = section.edges()
        along = math.cos(course_rad - heading) > 0
        return (edge_left - left, left - edge_right) if along else (left - edge_right, edge_left - left)

    def name(self) -> str:
        """The street's name, or its number."""
        return self.common.get("name") or self.common.get("ref", "")

    def tags_at(self, s: float) -> dict[str, str]:
        """All tags at a station."""
        return {**self.common, **self.section(s).tags}

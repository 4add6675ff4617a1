"""A player of OpenSCENARIO files that shares no code with this project, as far as the scenarios of packages need one.

Written from the standard: an entity's reference point follows the vertices of its trajectory, linearly in time
between them; its box has the dimensions of ``BoundingBox`` around a centre given from that point, ahead and to the
left. Two entities collide when their boxes overlap, seen from above, a vehicle (``V2``) never with its own trailer
(``T2``).
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from itertools import combinations
from xml.etree import ElementTree

import numpy as np
from shapely.geometry import Polygon

_STRAIGHT_ON_S, _JUST_BEFORE_S = 5.0, 0.1


@dataclass(frozen=True)
class Box:
    ahead_m: float
    left_m: float
    up_m: float
    length_m: float
    width_m: float


@dataclass(frozen=True)
class Collision:
    time_s: float
    x_m: float
    y_m: float
    entities: tuple[str, str]


class Scenario:
    """What a file says: ``boxes`` and ``vertices`` by entity, the latter with columns time, x, y, z, h, p, r."""

    def __init__(self, xml: bytes) -> None:
        self.root = ElementTree.fromstring(xml)
        self.boxes = {}
        for entity in self.root.iterfind("Entities/ScenarioObject"):
            box = entity.find("*/BoundingBox")
            centre, size = box.find("Center"), box.find("Dimensions")
            self.boxes[entity.get("name")] = Box(
                *(float(centre.get(axis)) for axis in "xyz"), float(size.get("length")), float(size.get("width"))
            )
        self.vertices = {}
        for group in self.root.iter("ManeuverGroup"):
            timing = group.find(".//TimeReference/Timing")
            if timing is None or timing.get("domainAbsoluteRelative") != "absolute":
                continue  # goes by somebody else, not by the clock
            scale, offset = float(timing.get("scale")), float(timing.get("offset"))
            rows = np.array([_row(vertex) for vertex in group.iterfind(".//Polyline/Vertex")])
            rows[:, 0] = rows[:, 0] * scale + offset
            self.vertices[group.find("Actors/EntityRef").get("entityRef")] = rows
        self.initial = {
            private.get("entityRef"): [
                float(private.find(".//TeleportAction/Position/WorldPosition").get(name, "0")) for name in "xyzhpr"
            ]
            for private in self.root.iterfind("Storyboard/Init/Actions/Private")
        }

    def reference(self, entity: str, times_s: np.ndarray) -> np.ndarray:
        """Reference point at some times, columns x, y, z, h, p, r."""
        rows = self.vertices[entity]
        return np.stack([np.interp(times_s, rows[:, 0], rows[:, i]) for i in range(1, 7)], axis=-1)

    def centres(self, entity: str, times_s: np.ndarray) -> np.ndarray:
        """Middle of the box seen from above at some times, columns x, y, h."""
        x, y, _, h, p, r = self.reference(entity, times_s).T
        box = self.boxes[entity]
        # Turned by roll about the axis ahead, pitch about the one to the left, and heading about the vertical.
        left_m = box.left_m * np.cos(r) - box.up_m * np.sin(r)
        ahead_m = box.ahead_m * np.cos(p) + (box.left_m * np.sin(r) + box.up_m * np.cos(r)) * np.sin(p)
        c, s = np.cos(h), np.sin(h)
        return np.stack([x + ahead_m * c - left_m * s, y + ahead_m * s + left_m * c, h], axis=-1)

    def outline(self, entity: str, time_s: float) -> Polygon:
        """The box from above."""
        x, y, _, h, _, _ = self.reference(entity, np.array([time_s]))[0]
        return self.box_at(entity, x, y, h)

    def box_at(self, entity: str, x: float, y: float, h: float) -> Polygon:
        """The box from above with the reference point in a place."""
        box, c, s = self.boxes[entity], math.cos(h), math.sin(h)
        half_l, half_w = box.length_m / 2, box.width_m / 2
        corners = ((half_l, half_w), (-half_l, half_w), (-half_l, -half_w), (half_l, -half_w))
        ahead, left = box.ahead_m, box.left_m
        return Polygon(
            [(x + (ahead + a) * c - (left + b) * s, y + (ahead + a) * s + (left + b) * c) for a, b in corners]
        )

    def play(self, step_s: float) -> Collision | None:
        """Plays in fixed steps to the end; the first collision."""
        end_s = min(rows[-1, 0] for rows in self.vertices.values())
        times = np.arange(0.0, end_s + step_s / 2, step_s)
        places = {entity: self.centres(entity, times) for entity in self.vertices}
        found = []
        for one, two in combinations(self.vertices, 2):
            if {one[0], two[0]} == {"T", "V"} and one[1:] == two[1:]:
                continue
            reach = sum(math.hypot(self.boxes[each].length_m, self.boxes[each].width_m) / 2 for each in (one, two))
            near = np.hypot(*(places[one][:, :2] - places[two][:, :2]).T) < reach
            for time_s in times[near]:
                shared = self.outline(one, time_s).intersection(self.outline(two, time_s))
                if shared.area > 0:
                    found.append(Collision(float(time_s), shared.centroid.x, shared.centroid.y, (one, two)))
                    break
        return min(found, key=lambda collision: collision.time_s, default=None)


def driven_without_reacting(scenario: bytes, recorded: bytes, name: str, until_s: float, pace: float) -> bytes:
    """A scenario with somebody at the wheel of its free vehicle who drives its way in ``recorded`` at so many times
    its speed, and from the place where it was at a time straight on."""
    root, source = ElementTree.fromstring(scenario), ElementTree.fromstring(recorded)
    for parent in root.iter():
        for gone in ("ObjectController", "ControllerAction"):
            for child in parent.findall(gone):
                parent.remove(child)
    for actions in root.iter("Private"):
        for empty in [each for each in actions if not len(each)]:
            actions.remove(empty)
    group = copy.deepcopy(source.find(f".//ManeuverGroup[@name='{name}_group']"))
    line = group.find(".//Polyline")
    rows = np.array([_row(vertex) for vertex in line])

    def at(time_s: float) -> np.ndarray:
        return np.array([np.interp(time_s, rows[:, 0], column) for column in rows.T])

    touch = at(until_s)
    straight_on = touch + (touch - at(until_s - _JUST_BEFORE_S)) / _JUST_BEFORE_S * _STRAIGHT_ON_S
    straight_on[4:] = touch[4:]
    vertex = line[0]
    line[:] = []
    for row in [*rows[rows[:, 0] < until_s - _JUST_BEFORE_S / 100], touch, straight_on]:
        added = copy.deepcopy(vertex)
        added.set("time", str(row[0] / pace))
        for axis, value in zip("xyzhpr", row[1:], strict=True):
            added.find("Position/WorldPosition").set(axis, str(value))
        line.append(added)
    root.find(".//Act").insert(0, group)
    return ElementTree.tostring(root)


def _row(vertex: ElementTree.Element) -> list[float]:
    position = vertex.find("Position/WorldPosition")
    return [float(vertex.get("time")), *(float(position.get(name, "0")) for name in "xyzhpr")]

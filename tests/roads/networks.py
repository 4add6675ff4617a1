"""Small networks made by hand, and generated reference lines, for tests."""

from __future__ import annotations

import math

from hypothesis import strategies as st

from trace_dag.common.geometry import LocalFrame
from trace_dag.roads.map.model import (
    Connection,
    ContactPoint,
    Cubic,
    Junction,
    Lane,
    LaneSection,
    LaneType,
    PlanElement,
    Road,
    RoadLink,
)
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.roads.map.reference_line import ReferenceLine

FRAME = LocalFrame(38.8951, -77.0364)
WIDTH_M = 3.5


@st.composite
def plans(draw: st.DrawFn) -> tuple[PlanElement, ...]:
    """Smooth reference lines of lines, arcs and cubics, all of them wider in radius than a lane or three."""
    x, y, heading = draw(st.floats(-50, 50)), draw(st.floats(-50, 50)), draw(st.floats(-3.1, 3.1))
    s = 0.0
    elements: list[PlanElement] = []
    for _ in range(draw(st.integers(1, 4))):
        length = draw(st.floats(3, 60))
        kind = draw(st.sampled_from(["line", "arc", "poly"]))
        if kind == "line":
            element = PlanElement(s, x, y, heading, length)
        elif kind == "arc":
            turn = draw(st.floats(0.05, 1.2)) * draw(st.sampled_from([-1, 1]))
            curvature = math.copysign(min(abs(turn) / length, 1 / 20), turn)
            element = PlanElement(s, x, y, heading, length, curvature_1pm=curvature)
        else:
            bend = draw(st.floats(-0.1, 0.1)) * length * min(1.0, length / 20)
            # Hermite: from (0,0) heading along u to (length, bend) heading along u again.
            poly = (0.0, length, 0.0, 0.0, 0.0, 0.0, 3 * bend, -2 * bend)
            element = PlanElement(s, x, y, heading, math.hypot(length, bend), poly=poly, poly_normalized=True)
        elements.append(element)
        s += element.length_m
        x, y, heading, _ = ReferenceLine(tuple(elements), s).at(s)
    return tuple(elements)


def lanes(left: int, right: int, width_m: float = WIDTH_M) -> tuple[Lane, ...]:
    """Driving lanes, from left to right, centre lane left out."""
    ids = [*range(left, 0, -1), *range(-1, -right - 1, -1)]
    return tuple(Lane(i, LaneType.DRIVING, (Cubic(0, width_m),)) for i in ids)


def one_road(plan: tuple[PlanElement, ...], *, lanes_left: int, lanes_right: int, width_m: float) -> RoadNetwork:
    """A network of a single road."""
    length = plan[-1].s_m + plan[-1].length_m
    road = Road("1", length, plan, (LaneSection(0.0, lanes(lanes_left, lanes_right, width_m)),))
    return RoadNetwork(FRAME, (road,))


def curvy_road(plan: tuple[PlanElement, ...]) -> RoadNetwork:
    """One lane each way with a lane offset, a widening and a hill, everything smooth."""
    length = plan[-1].s_m + plan[-1].length_m
    third = length / 3
    widening = Cubic(third, 3.0, 0.0, 3 * 0.8 / third**2, -2 * 0.8 / third**3)
    both = tuple(Lane(i, LaneType.DRIVING, (Cubic(0, 3.0), widening, Cubic(2 * third, 3.8))) for i in (1, -1))
    offset = (Cubic(0, 0.0, 0.0, 3 * 0.5 / length**2, -2 * 0.5 / length**3),)
    hill = (Cubic(0, 1.0, 0.03, -0.03 / length),)
    road = Road("1", length, plan, (LaneSection(0.0, both),), elevation=hill, lane_offset=offset)
    return RoadNetwork(FRAME, (road,))


_ARMS = {"west": math.pi, "south": -math.pi / 2, "east": 0.0, "north": math.pi / 2}


def crossroads(radius_m: float = 10.0, arm_m: float = 100.0) -> RoadNetwork:
    """Four two-lane arms, each running towards the junction at the origin, and all twelve movements.

    Arms lie at their compass side; connecting roads have one lane, whose centre is the reference line shifted by half
    a width (lane offset), so that it meets the arms' lane centres.
    """
    roads: list[Road] = []
    connections: list[Connection] = []
    for name, bearing in _ARMS.items():
        inward = bearing + math.pi
        start = (radius_m + arm_m) * math.cos(bearing), (radius_m + arm_m) * math.sin(bearing)
        plan = (PlanElement(0, *start, inward, arm_m),)
        roads.append(
            Road(name, arm_m, plan, (LaneSection(0, lanes(1, 1)),), name=name, successor=RoadLink("junction", "J"))
        )
    for number, (source, target) in enumerate((a, b) for a in _ARMS for b in _ARMS if a != b):
        plan = _turn(_ARMS[source], _ARMS[target], radius_m)
        length = plan[-1].s_m + plan[-1].length_m
        lane = Lane(-1, LaneType.DRIVING, (Cubic(0, WIDTH_M),), predecessor=-1, successor=1)
        road_id = f"{source}-{target}"
        roads.append(
            Road(
                road_id,
                length,
                plan,
                (LaneSection(0, (lane,)),),
                lane_offset=(Cubic(0, WIDTH_M / 2),),
                junction_id="J",
                predecessor=RoadLink("road", source, ContactPoint.END),
                successor=RoadLink("road", target, ContactPoint.END),
            )
        )
        connections.append(Connection(str(number), source, road_id, ContactPoint.START, ((-1, -1),)))
    return RoadNetwork(FRAME, tuple(roads), (Junction("J", tuple(connections)),))


def _turn(source: float, target: float, radius_m: float) -> tuple[PlanElement, ...]:
    """From the lane that comes in from one bearing to the one that leaves to another: line, arc, line or one line."""
    inward = source + math.pi
    # Lane centres: right of the arm's axis as seen in the direction of travel.
    x0 = radius_m * math.cos(source) + WIDTH_M / 2 * math.sin(inward)
    y0 = radius_m * math.sin(source) - WIDTH_M / 2 * math.cos(inward)
    x1 = radius_m * math.cos(target) + WIDTH_M / 2 * math.sin(target)
    y1 = radius_m * math.sin(target) - WIDTH_M / 2 * math.cos(target)
    turn = math.remainder(target - inward, math.tau)
    if abs(turn) < 1e-9:
        return (PlanElement(0, x0, y0, inward, math.hypot(x1 - x0, y1 - y0)),)
    chord = math.hypot(x1 - x0, y1 - y0)
    radius = chord / (2 * math.sin(abs(turn) / 2))
    return (PlanElement(0, x0, y0, inward, radius * abs(turn), curvature_1pm=turn / (radius * abs(turn))),)


def ring() -> RoadNetwork:
    """A road that leaves a junction and comes back to it, with a different continuation behind either end."""
    loop = Road(
        "loop",
        80.0,
        (PlanElement(0, 0, 0, 0, 80.0, curvature_1pm=2 * math.pi * 0.75 / 80),),
        (LaneSection(0, lanes(1, 1)),),
        predecessor=RoadLink("junction", "J"),
        successor=RoadLink("junction", "J"),
    )

    def connecting(name: str, contact: ContactPoint, lane_id: int) -> tuple[Road, Connection]:
        x, y, heading, _ = ReferenceLine(loop.plan, loop.length_m).at(80.0 if contact == "end" else 0.0)
        lane = Lane(-1, LaneType.DRIVING, (Cubic(0, WIDTH_M),), predecessor=lane_id)
        road = Road(
            name,
            10.0,
            (PlanElement(0, x, y, heading, 10.0),),
            (LaneSection(0, (lane,)),),
            junction_id="J",
            predecessor=RoadLink("road", "loop", contact),
        )
        return road, Connection(name, "loop", name, ContactPoint.START, ((lane_id, -1),))

    after_end, from_end = connecting("after-end", ContactPoint.END, -1)
    after_start, from_start = connecting("after-start", ContactPoint.START, 1)
    return RoadNetwork(FRAME, (loop, after_end, after_start), (Junction("J", (from_end, from_start)),))

"""Rules for links in an OpenDRIVE 1.7 file: roads and lanes that follow each other, and junctions with their roads.

Belongs here: what needs both sides of a link (ASAM OpenDRIVE 1.7.0, sections 10 to 12). Rules that concern single
elements are in :mod:`~trace_dag.roads.map.rules`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

from lxml import etree


def broken_links(root: etree._Element) -> Iterator[str]:
    """Every broken rule of links, with where it is broken.

    >>> link = '<link><successor elementType="road" elementId="2"/></link>'
    >>> list(broken_links(etree.fromstring(f'<OpenDRIVE><road id="1">{link}</road></OpenDRIVE>')))
    ['successor is road 2, which does not exist (road 1)']
    """
    ends = _Ends(root)
    for rule in (_road_links, _lane_links, _junctions):
        yield from rule(ends)


class _Ends:
    """Lane ids at both ends of every road."""

    def __init__(self, root: etree._Element) -> None:
        self.lane_ids: dict[tuple[str, str], set[str]] = {}
        self.roads = {road.get("id", ""): road for road in root.iterfind("road")}
        self.junctions = {junction.get("id", ""): junction for junction in root.iterfind("junction")}
        for key, road in self.roads.items():
            sections = road.findall("lanes/laneSection")
            if sections:
                self.lane_ids[key, "start"] = _lane_ids(sections[0])
                self.lane_ids[key, "end"] = _lane_ids(sections[-1])


def _lane_ids(section: etree._Element) -> set[str]:
    return {lane.get("id", "") for side in section for lane in side.iterchildren("lane") if lane.get("id") != "0"}


def _road_links(ends: _Ends) -> Iterator[str]:
    for key, road in ends.roads.items():
        in_junction = road.get("junction", "-1") != "-1"
        for which, own_end in (("predecessor", "start"), ("successor", "end")):
            link = road.find(f"link/{which}")
            if link is None:
                continue
            target, contact = link.get("elementId", ""), link.get("contactPoint")
            if link.get("elementType") == "junction":
                if target not in ends.junctions:
                    yield f"{which} is junction {target}, which does not exist (road {key})"
                elif in_junction:
                    yield f"{which} of a connecting road is a junction (road {key})"
            elif target not in ends.roads:
                yield f"{which} is road {target}, which does not exist (road {key})"
            elif contact is None:
                yield f"{which} is a road without contactPoint (road {key})"
            elif not in_junction and ends.roads[target].get("junction", "-1") == "-1":
                back = ends.roads[target].find(f"link/{'predecessor' if contact == 'start' else 'successor'}")
                if back is None or (back.get("elementId"), back.get("contactPoint")) != (key, own_end):
                    yield f"{which} is the {contact} of road {target}, which does not link back (road {key})"


def _lane_links(ends: _Ends) -> Iterator[str]:
    for key, road in ends.roads.items():
        sections = road.findall("lanes/laneSection")
        ids = [_lane_ids(section) for section in sections]
        for index, section in enumerate(sections):
            known = {
                which: _linked_lane_ids(ends, road, ids, index + step, which)
                for which, step in (("predecessor", -1), ("successor", 1))
            }
            for lane in (lane for side in section for lane in side.iterchildren("lane") if lane.get("id") != "0"):
                for link in (link for links in lane.iterchildren("link") for link in links):
                    if link.tag in known and link.get("id") not in known[link.tag]:
                        yield (
                            f"{link.tag} of lane {lane.get('id')} is lane {link.get('id')}, which does not exist there "
                            f"(road {key}, section {index})"
                        )


def _linked_lane_ids(ends: _Ends, road: etree._Element, ids: list[set[str]], index: int, which: str) -> set[str]:
    """Lane ids a lane link at one end of a section may name."""
    if 0 <= index < len(ids):
        return ids[index]
    link = road.find(f"link/{which}")
    if link is None or link.get("elementType") != "road":
        return set()
    return ends.lane_ids.get((link.get("elementId", ""), link.get("contactPoint", "")), set())


def _junctions(ends: _Ends) -> Iterator[str]:
    used: set[str] = set()
    for key, junction in ends.junctions.items():
        connections = junction.findall("connection")
        if not connections:
            yield f"no connection (junction {key})"
        for connection in connections:
            used.add(connection.get("connectingRoad", ""))
            where = f"junction {key}, connection {connection.get('id')}"
            yield from (f"{problem} ({where})" for problem in _connection(ends, key, connection))
    yield from _connecting_roads(ends, used)


def _connection(ends: _Ends, junction: str, connection: etree._Element) -> Iterator[str]:
    """A connection's two roads, whether they and the junction name each other, and its lane links."""
    incoming, connecting = connection.get("incomingRoad", ""), connection.get("connectingRoad", "")
    if incoming not in ends.roads or connecting not in ends.roads:
        yield f"joins road {incoming} to road {connecting}, one of which does not exist"
        return
    if ends.roads[connecting].get("junction") != junction:
        yield f"connecting road {connecting} does not belong to the junction"
    contact = connection.get("contactPoint", "")
    own_link = ends.roads[connecting].find(f"link/{'predecessor' if contact == 'start' else 'successor'}")
    if own_link is None or own_link.get("elementId") != incoming:
        yield f"connecting road {connecting} does not link back to road {incoming}"
        return
    at = own_link.get("contactPoint", "")
    arm_link = ends.roads[incoming].find(f"link/{'predecessor' if at == 'start' else 'successor'}")
    if arm_link is None or (arm_link.get("elementType"), arm_link.get("elementId")) != ("junction", junction):
        yield f"incoming road {incoming} does not link to the junction at its {at}"
    links = connection.findall("laneLink")
    if not links:
        yield "no lane link"
    for link in links:
        if link.get("from") not in ends.lane_ids.get((incoming, at), ()):
            yield f"lane link from lane {link.get('from')}, which does not exist"
        if link.get("to") not in ends.lane_ids.get((connecting, contact), ()):
            yield f"lane link to lane {link.get('to')}, which does not exist"


def _connecting_roads(ends: _Ends, used: Collection[str]) -> Iterator[str]:
    """Whether every road of a junction is one that exists and is ``used`` by a connection."""
    for key, road in ends.roads.items():
        if road.get("junction", "-1") != "-1":
            if road.get("junction") not in ends.junctions:
                yield f"belongs to junction {road.get('junction')}, which does not exist (road {key})"
            elif key not in used:
                yield f"connecting road that no connection uses (road {key})"

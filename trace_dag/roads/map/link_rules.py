"""Rules for links in an OpenDRIVE 1.7 file: roads and lanes that follow each other, and junctions with their roads.

Belongs here: rules that need both sides of a link (ASAM OpenDRIVE 1.7.0, sections 10 to 12). Rules that concern single
elements are in :mod:`~trace_dag.roads.map.rules`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

from lxml import etree


def broken_links(root: etree._Element) -> Iterator[str]:
    """Yield every broken rule of links, with the place.

    >>> link = '<link><successor elementType="road" elementId="2"/></link>'
    >>> list(broken_links(etree.fromstring(f'<OpenDRIVE><road id="1">{link}</road></OpenDRIVE>')))
    ['successor is road 2, which does not exist (road 1)']
    """
    ends = _Ends(root)
    for rule in (_road_links, _lane_links, _junctions):
        yield from rule(ends)


class _Road:
    """A road for its links: its place, its predecessors and successors, the lanes of each section by id."""

    def __init__(self, element: etree._Element) -> None:
        self.junction: str = element.get("junction", "-1")
        self.links: dict[str, etree._Element] = {}
        self.sections: list[dict[str, etree._Element]] = []
        for child in element:
            if child.tag == "link":
                self.links |= {link.tag: link for link in child.iterchildren(reversed=True)}
            elif child.tag == "lanes":
                self.sections += map(_lanes, child.iterchildren("laneSection"))

    def link_at(self, end: str) -> etree._Element | None:
        """Return the link at the start or the end of the road."""
        return self.links.get("predecessor" if end == "start" else "successor")

    def lanes_at(self, end: str) -> Collection[str]:
        """Return the ids of its lanes at the start or the end; empty for any other value."""
        if not self.sections or end not in ("start", "end"):
            return ()
        return self.sections[0 if end == "start" else -1]


class _Ends:
    """The roads and junctions of a map by id."""

    def __init__(self, root: etree._Element) -> None:
        self.roads = {road.get("id", ""): _Road(road) for road in root.iterchildren("road")}
        self.junctions = {junction.get("id", ""): junction for junction in root.iterchildren("junction")}

    def lanes_at(self, road_id: str, end: str) -> Collection[str]:
        """Return the ids of the lanes at an end of a road; empty if there is no such road."""
        return self.roads[road_id].lanes_at(end) if road_id in self.roads else ()


def _lanes(section: etree._Element) -> dict[str, etree._Element]:
    lanes = {lane.get("id", ""): lane for side in section for lane in side.iterchildren("lane")}
    lanes.pop("0", None)
    return lanes


def _road_links(ends: _Ends) -> Iterator[str]:
    for key, road in ends.roads.items():
        in_junction = road.junction != "-1"
        for which, own_end in (("predecessor", "start"), ("successor", "end")):
            link = road.links.get(which)
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
            elif not in_junction and ends.roads[target].junction == "-1":
                back = ends.roads[target].link_at(contact)
                if back is None or (back.get("elementId"), back.get("contactPoint")) != (key, own_end):
                    yield f"{which} is the {contact} of road {target}, which does not link back (road {key})"


def _lane_links(ends: _Ends) -> Iterator[str]:
    for key, road in ends.roads.items():
        for index, section in enumerate(road.sections):
            known = {
                which: _linked_lane_ids(ends, road, index + step, which)
                for which, step in (("predecessor", -1), ("successor", 1))
            }
            for lane_id, lane in section.items():
                for link in (link for links in lane.iterchildren("link") for link in links):
                    if link.tag in known and link.get("id") not in known[link.tag]:
                        yield (
                            f"{link.tag} of lane {lane_id} is lane {link.get('id')}, which does not exist there "
                            f"(road {key}, section {index})"
                        )


def _linked_lane_ids(ends: _Ends, road: _Road, index: int, which: str) -> Collection[str]:
    """Return the lane ids that a lane link at one end of a section may name."""
    if 0 <= index < len(road.sections):
        return road.sections[index]
    link = road.links.get(which)
    if link is None or link.get("elementType") != "road":
        return ()
    return ends.lanes_at(link.get("elementId", ""), link.get("contactPoint", ""))


def _junctions(ends: _Ends) -> Iterator[str]:
    used: set[str] = set()
    for key, junction in ends.junctions.items():
        connections = list(junction.iterchildren("connection"))
        if not connections:
            yield f"no connection (junction {key})"
        for connection in connections:
            used.add(connection.get("connectingRoad", ""))
            where = f"junction {key}, connection {connection.get('id')}"
            yield from (f"{problem} ({where})" for problem in _connection(ends, key, connection))
    yield from _connecting_roads(ends, used)


def _connection(ends: _Ends, junction: str, connection: etree._Element) -> Iterator[str]:
    """Yield faults of a connection: its two roads, their mutual naming with the junction, and its lane links."""
    incoming, connecting = connection.get("incomingRoad", ""), connection.get("connectingRoad", "")
    if incoming not in ends.roads or connecting not in ends.roads:
        yield f"joins road {incoming} to road {connecting}, one of which does not exist"
        return
    if ends.roads[connecting].junction != junction:
        yield f"connecting road {connecting} does not belong to the junction"
    contact = connection.get("contactPoint", "")
    own_link = ends.roads[connecting].link_at(contact)
    if own_link is None or own_link.get("elementId") != incoming:
        yield f"connecting road {connecting} does not link back to road {incoming}"
        return
    at = own_link.get("contactPoint", "")
    arm_link = ends.roads[incoming].link_at(at)
    if arm_link is None or (arm_link.get("elementType"), arm_link.get("elementId")) != ("junction", junction):
        yield f"incoming road {incoming} does not link to the junction at its {at}"
    links = list(connection.iterchildren("laneLink"))
    if not links:
        yield "no lane link"
    for link in links:
        if link.get("from") not in ends.lanes_at(incoming, at):
            yield f"lane link from lane {link.get('from')}, which does not exist"
        if link.get("to") not in ends.lanes_at(connecting, contact):
            yield f"lane link to lane {link.get('to')}, which does not exist"


def _connecting_roads(ends: _Ends, used: Collection[str]) -> Iterator[str]:
    """Yield roads of a junction that do not exist or that no connection has ``used``."""
    for key, road in ends.roads.items():
        if road.junction != "-1":
            if road.junction not in ends.junctions:
                yield f"belongs to junction {road.junction}, which does not exist (road {key})"
            elif key not in used:
                yield f"connecting road that no connection uses (road {key})"

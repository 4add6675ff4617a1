"""The road map as a network for SUMO, made by its netconvert, and the location of SUMO."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from importlib.util import find_spec
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Final

from lxml import etree

from trace_dag.common.errors import Failure, UserError
from trace_dag.osm.road_classes import ROAD_CLASSES, road_class
from trace_dag.roads.map.model import SignalType
from trace_dag.roads.map.network import RoadNetwork
from trace_dag.scenario.lights import Colour, Lights

_LANE: Final = re.compile(r"_(-?\d+)(?= |$)")  # of an origId
_TIME_LIMIT_S: Final = 300.0
SUMO_PARSER: Final = etree.XMLParser(remove_comments=True, resolve_entities=False, no_network=True, huge_tree=True)
"""Parser of SUMO's files, which fetches nothing."""
_YIELDING: Final = (SignalType.YIELD, SignalType.STOP)
_LOWEST_RANK: Final = max(each.rank for each in ROAD_CLASSES.values())


def sumo_homes() -> list[Path]:
    """Return the possible folders of SUMO: the package of the extra ``sumo``, and ``SUMO_HOME``."""
    package = find_spec("sumo")
    homes = [Path(each) for each in (package.submodule_search_locations or [])] if package else []
    return [*homes, *([Path(os.environ["SUMO_HOME"])] if "SUMO_HOME" in os.environ else [])]


def sumo_program(name: str) -> str:
    """Return the path of one of SUMO's programs: from the extra ``sumo``, ``SUMO_HOME``, or ``PATH``.

    Raises :class:`UserError` if it is missing.
    """
    found = next(filter(None, (shutil.which(name, path=str(home / "bin")) for home in sumo_homes())), None)
    found = found or shutil.which(name)
    if found is None:
        raise UserError(f"SUMO's {name} is needed and not here: pip install 'trace-dag[sumo]', or set SUMO_HOME")
    return found


def network_xml(program: str, key: str, network: RoadNetwork, xodr: bytes) -> bytes:
    """Return the map converted by netconvert with unchanged positions, and with :func:`edge_patch` applied.

    Raises :class:`Failure` if netconvert fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "map.xodr").write_bytes(xodr)
        left = ["--lefthand"] if any(road.left_hand for road in network.roads) else []  # it does not read the rule
        read = _converted(program, key, folder, *left)
        Path(folder, "map.edg.xml").write_bytes(edge_patch(network, read))
        patched = _converted(program, key, folder, "--edge-files", "map.edg.xml", *left)
        return etree.tostring(patched, xml_declaration=True, encoding="UTF-8")


def edge_patch(network: RoadNetwork, read: etree._Element) -> bytes:
    """Return facts that netconvert drops from OpenDRIVE, for the edges of the network that it made.

    It gives every edge priority 1, so a through road may yield to a side street at a crossing. Here priorities are by
    road class, a link's one less than its class's, and 0 at a stop or yield sign. It gives a lane without a limit 13.89
    m/s, and a centre turn lane 1.39 m/s; here they get the usual limit of the road's class, marked ``assumedSpeed``.
    """
    patch = etree.Element("edges")
    for edge in read.iterfind("edge[@priority]"):
        changed = etree.SubElement(patch, "edge", id=edge.get("id", ""))
        for lane in edge.iterfind("lane"):
            road_id, lane_id = origin_of(lane)
            road = network.road_by_id[road_id]
            usual = road_class(road.highway)
            yields = any(sign.type in _YIELDING and int(lane_id) in road.lanes_under(sign) for sign in road.signals)
            rank = usual.rank + road.highway.endswith("_link")
            changed.set("priority", "0" if yields else changed.get("priority", str(_LOWEST_RANK + 1 - rank)))
            limits = [each.speed_mps for part in road.lane_sections for each in part.lanes if each.id == int(lane_id)]
            if None in limits:
                limit_mps = next(filter(None, (*limits, road.speed_mps)), None)
                speed = f"{limit_mps or usual.speed_mps:.2f}"
                made = etree.SubElement(changed, "lane", index=lane.get("index", ""), speed=speed)
                if limit_mps is None:
                    etree.SubElement(made, "param", key="assumedSpeed", value="true")
    return etree.tostring(patch)


def programs_xml(net: etree._Element, lights: Lights | None, *, begins_s: float) -> bytes:
    """Return the programs of a network's lights by a crash's, whose clock is 0 at ``begins_s``.

    A link that no light of the map is for yields while the others have theirs.
    """
    root, cycle_of = etree.Element("additional"), {} if lights is None else lights.cycle_of
    for logic in net.iterfind("tlLogic"):
        names = {
            each.get("key", "").partition(":")[2]: each.get("value", "").split() for each in logic.iterfind("param")
        }
        cycles = {int(link): cycle_of[name] for link, (name, *_) in names.items() if name in cycle_of}
        if not cycles:
            continue
        states = [each.get("state", "") for each in logic.iterfind("phase")]
        go = ["G" if any(state[link] == "G" for state in states) else "g" for link in range(len(states[0]))]
        ends_s = sorted({round(end, 1) for each in cycles.values() for end in accumulate(s for s, _ in each.steps)})
        made = etree.SubElement(
            root, "tlLogic", id=logic.get("id", ""), type="static", programID="report", offset=f"{begins_s:g}"
        )
        for begin_s, end_s in pairwise((0.0, *ends_s)):
            shown = {link: each.at((begin_s + end_s) / 2) for link, each in cycles.items()}
            letters = (
                go[link] if shown.get(link) is Colour.GREEN else shown[link][0] if link in shown else "o"
                for link in range(len(go))
            )
            etree.SubElement(made, "phase", duration=f"{end_s - begin_s:.1f}", state="".join(letters))
    return etree.tostring(root)


def origin_of(lane: etree._Element) -> tuple[str, str]:
    """Return the ids of the (first) OpenDRIVE road and lane from which a network's lane is made."""
    road_id, _, lane_id = str(lane.xpath("string(param[@key='origId']/@value)")).split()[0].rpartition("_")
    return road_id, lane_id


def _converted(program: str, key: str, folder: str, *options: str) -> etree._Element:
    """Run netconvert on ``map.xodr`` of a folder.

    Lanes name their original road and lane (``origId``). The time and command at the beginning of its file are removed,
    so that equal maps give equal bytes. With ``--lefthand`` netconvert 1.28 names each lane after the one across the
    road's reference line; this is corrected.
    """
    command = [program, "--opendrive-files", "map.xodr", "--output-file", "map.net.xml", *options]
    command += ["--output.original-names", "true"]
    command += ["--offset.disable-normalization", "true", "--no-warnings", "true"]
    made = Path(folder, "map.net.xml")
    made.unlink(missing_ok=True)
    try:
        done = subprocess.run(  # noqa: S603 - SUMO's own program
            command, cwd=folder, capture_output=True, text=True, timeout=_TIME_LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise Failure(f"{key}: netconvert took longer than {_TIME_LIMIT_S:g} s") from error
    if done.returncode or not made.exists():
        raise Failure(f"{key}: netconvert made no network: {' '.join(done.stderr.split())[-300:]}")
    root = etree.fromstring(made.read_bytes(), SUMO_PARSER)
    if "--lefthand" in options:
        for name in root.iterfind(".//param[@key='origId']"):
            name.set("value", _LANE.sub(lambda lane: f"_{-int(lane[1])}", name.get("value", "")))
    return root

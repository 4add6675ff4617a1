"""One crash, wherever it is stored; each part is read on first use."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from trace_dag.common.errors import UserError
from trace_dag.flow.artefacts import (
    ESTIMATE,
    MAP_REPORT,
    RECORD,
    REPORT_JSON,
    REPORT_XML,
    ROAD_MAP,
    SAMPLED,
    VERDICT,
    Artefact,
    CrashArtefacts,
)

if TYPE_CHECKING:
    import networkx as nx
    import pandas as pd
    import pyarrow as pa
    from PIL.Image import Image

    from trace_dag.agents.replays import ReplayFormat
    from trace_dag.crash.record import CrashRecord
    from trace_dag.roads.map.network import RoadNetwork
    from trace_dag.roads.report import MapReport
    from trace_dag.scenario.drives import Drive
    from trace_dag.simulation.states import StateEstimate
    from trace_dag.simulation.types import SimulationLog
    from trace_dag.verdict.types import Verdict

T = TypeVar("T")


@dataclass(frozen=True)
class CrashReplay:
    """A replay of a crash. A notebook shows it; ``save`` writes it to a file."""

    content: bytes = field(repr=False)
    format: ReplayFormat
    title: str

    def save(self, path: str | Path) -> Path:
        """Write it to a file, and return the path. Raises :class:`UserError` for a name of another format."""
        target = Path(path)
        if target.suffix.lower() != f".{self.format}":
            raise UserError(f"{target}: the replay is {self.format}; name it so, or ask for replay(format)")
        target.write_bytes(self.content)
        return target

    def _repr_html_(self) -> str:
        if self.format == "html":
            page = escape(self.content.decode())
            return f'<div><iframe srcdoc="{page}" width="900" height="640" title="{escape(self.title)}"></iframe></div>'
        from base64 import b64encode

        data = b64encode(self.content).decode()
        if self.format == "glb":
            address = f"data:model/gltf-binary;base64,{data}"
            return f'<a download="crash.glb" href="{address}">{escape(self.title)}, glTF</a>'
        return f'<img src="data:image/webp;base64,{data}" alt="{escape(self.title)}">'


class Crash:
    """One crash of a root, a package or a release.

    Every part is read on first use, checked against its digest, and kept. A part that the crash did not reach (an
    estimate after a rejection at the map) raises :class:`trace_dag.common.errors.UserError`; a damaged one raises
    :class:`trace_dag.common.errors.Failure`. Frame: local transverse Mercator at the reported point, x east, y north,
    metres, radians counter-clockwise from east, m/s.
    """

    def __init__(self, stored: CrashArtefacts) -> None:
        self._stored = stored

    @property
    def key(self) -> str:
        """Return the crash's key, ``<caseYear>-<stateCase>`` or ``<register>-<id>``."""
        return self._stored.key

    @property
    def stored(self) -> CrashArtefacts:
        """Return the artefacts it is read from, for code of this package."""
        return self._stored

    def has(self, part: str) -> bool:
        """Return whether it reached ``report``, ``record``, ``road_map``, ``estimate``, ``log`` or ``verdict``."""
        if part == "log":
            return self._stored.shown_log() is not None
        if part not in _PARTS:
            raise UserError(f"a crash has no part {part!r}; expected {', '.join(_PARTS)} or log")
        return any(self._stored.has(artefact) for artefact in _PARTS[part])

    @property
    def report(self) -> bytes:
        """Return the report: XML from NHTSA's CrashAPI, or JSON from a table."""
        return self._load(REPORT_XML if self._stored.has(REPORT_XML) else REPORT_JSON, "report")

    @property
    def record(self) -> CrashRecord:
        """Return the record, read and checked."""
        return self._load(RECORD, "record")

    @property
    def road_map(self) -> RoadNetwork:
        """Return the road as read from OpenDRIVE."""
        return self._load(ROAD_MAP, "road_map")

    @property
    def map_report(self) -> MapReport:
        """Return the crash's place on the map, and the measures of the map."""
        return self._load(MAP_REPORT, "road_map")

    @property
    def estimate(self) -> StateEstimate:
        """Return the estimate: hypotheses about the initial states of all parties, best first."""
        return self._load(ESTIMATE, "estimate")

    @property
    def log(self) -> SimulationLog:
        """Return the simulated motion and contacts, of the hypothesis that the verdict is about."""
        found = self._stored.shown_log()
        if found is None:
            raise self._missing("log")
        return found

    @property
    def verdict(self) -> Verdict:
        """Return every criterion with its value, and the verdict."""
        return self._load(VERDICT, "verdict")

    # --- tables ----------------------------------------------------------------------------------------------------
    @property
    def steps(self) -> pd.DataFrame:
        """Return the log as a table.

        It has a row per party and logged step, with columns as in :data:`trace_dag.simulation.log_io.SIMULATION_STEPS`.
        """
        frame: pd.DataFrame = self.steps_arrow.to_pandas()
        return frame

    @cached_property
    def steps_arrow(self) -> pa.Table:
        """Return :attr:`steps` as an Arrow table, with the unit and meaning of each column in its schema."""
        from trace_dag.simulation.log_io import steps_table

        return steps_table([self.log]).drop_columns(["hypothesis"])

    @property
    def contacts(self) -> pd.DataFrame:
        """Return a row per contact: time, place, parties, closing speed, impulse, delta-v."""
        import pandas as pd

        from trace_dag.simulation.types import Contact

        names = [each.name for each in fields(Contact)]
        return pd.DataFrame([[getattr(each, name) for name in names] for each in self.log.contacts], columns=names)

    @property
    def criteria(self) -> pd.DataFrame:
        """Return a row per criterion of the verdict: value, threshold, unit, whether it holds."""
        import pandas as pd

        return pd.DataFrame([asdict(each) for each in self.verdict.criteria])

    @property
    def intervals(self) -> pd.DataFrame:
        """Return the uncertainty of the estimate.

        It has a row per quantity and party (None for the crash as a whole), with unit.

        ``best`` is the value in the best hypothesis; four in five draws lie between ``low`` and ``high``, ``middle`` is
        their median. There are no rows if nothing was drawn.
        """
        import pandas as pd

        from trace_dag.reconstruction.samples.simulated import Interval

        rows = self._load(SAMPLED, "log").intervals if self._stored.has(SAMPLED) else ()
        return pd.DataFrame([asdict(row) for row in rows], columns=[each.name for each in fields(Interval)])

    @property
    def likely_courses(self) -> pd.DataFrame:
        """Return other likely courses of the crash, the likeliest first.

        It has a row per ``course`` (from 1), body and tenth of a second from its contact (``time_s``), with ``weight``
        (1 for all draws together), ``number``, ``x_m``, ``y_m`` (to 5 cm), ``heading_rad``.

        There are no rows if nothing was drawn.
        """
        import numpy as np
        import pandas as pd

        from trace_dag.reconstruction.samples.crash import STEP_S

        columns = ["course", "weight", "number", "time_s", "x_m", "y_m", "heading_rad"]
        if not self._stored.has(SAMPLED):
            return pd.DataFrame(columns=columns)
        sampled = self._load(SAMPLED, "log")
        parts = []
        for k, course in enumerate(sampled.courses):
            for body in course.bodies:
                part = pd.DataFrame(body.poses, columns=columns[4:])
                part["time_s"] = np.round(course.begins_s + STEP_S * np.arange(len(part)), 3)
                part["course"], part["number"] = k + 1, body.number
                part["weight"] = sampled.contact_of(course).weight
                parts.append(part[columns])
        return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=columns)

    # --- what everybody was going to do ----------------------------------------------------------------------------
    @property
    def courses(self) -> pd.DataFrame:
        """Return the courses of all parties without the crash.

        A row per party or trailer and tenth of a second, columns ``number``, ``time_s``, ``x_m``, ``y_m``, ``z_m`` (the
        middle of the body), ``heading_rad``, ``speed_mps``.
        """
        import numpy as np
        import pandas as pd

        from trace_dag.scenario.drives import COURSE_COLUMNS, STEP_S

        parts = []
        for drive in self._drives:
            part = pd.DataFrame(drive.course, columns=list(COURSE_COLUMNS))
            parts.append(part.assign(number=drive.number, time_s=np.arange(len(part)) * STEP_S))
        return pd.concat(parts, ignore_index=True)[["number", "time_s", *COURSE_COLUMNS]]

    @property
    def routes(self) -> pd.DataFrame:
        """Return a row per driver, indexed by ``number``, with the ``lanes`` of the intended course, in order.

        Other columns are ``route`` (shapely ``LineString`` with heights) and ``goal`` (``Polygon``), to be reached
        between ``from_s`` and ``to_s``.
        """
        import numpy as np
        import pandas as pd
        import shapely

        from trace_dag.common.geometry import rectangle_corners
        from trace_dag.scenario.drives import GOAL_LENGTH_M, GOAL_WIDTH_M

        rows = {}
        for drive in self._drives:
            if drive.route is None or drive.goal is None:
                continue
            path = drive.route.path
            rows[drive.number] = {
                "lanes": list(drive.route.lanes),
                "route": shapely.LineString(np.column_stack([path.x_m, path.y_m, path.z_m])),
                "goal": shapely.Polygon(rectangle_corners(drive.goal.pose, GOAL_LENGTH_M, GOAL_WIDTH_M)),
                "from_s": drive.goal.from_s,
                "to_s": drive.goal.to_s,
            }
        return pd.DataFrame.from_dict(rows, orient="index").rename_axis("number")

    @cached_property
    def _drives(self) -> tuple[Drive, ...]:
        from trace_dag.agents.stored_cases import case_of
        from trace_dag.common.settings import SimSettings
        from trace_dag.scenario.drives import drives_of

        if not self._stored.has(VERDICT):
            raise self._missing("verdict")
        return drives_of(case_of(self._stored, SimSettings()))

    # --- roads -----------------------------------------------------------------------------------------------------
    @property
    def lanes(self) -> pd.DataFrame:
        """Return a row per lane: centre (shapely ``LineString``), surface (``Polygon``), and the lanes around it.

        See :func:`trace_dag.reading.road_map.lane_table`. ``geopandas.GeoDataFrame(crash.lanes, geometry="surface",
        crs=crash.road_map.frame.proj)`` takes it as it is.
        """
        from trace_dag.reading.road_map import lane_table

        return lane_table(self.road_map)

    def lane_graph(self) -> nx.DiGraph[Any]:
        """Return the drivable lanes as a networkx graph; see :func:`trace_dag.reading.road_map.lane_graph`.

        The extra ``graph``.
        """
        from trace_dag.reading.road_map import lane_graph

        return lane_graph(self.road_map)

    # --- to look at ------------------------------------------------------------------------------------------------
    def figure(self) -> Image:
        """Draw the crash from above, as a picture (Pillow) of 1170 by 648 pixels."""
        from trace_dag.flow.crash_picture import draw_sketch
        from trace_dag.pages.canvas import pixels_of
        from trace_dag.pages.pictures import WIDTH_PX

        svg = draw_sketch(self._stored)
        if svg is None:
            raise self._missing("road_map")
        return pixels_of(svg, WIDTH_PX)

    def replay(self, replay_format: ReplayFormat = "html") -> CrashReplay:
        """Return the replay of the simulated crash.

        It is a page with a time slider, a moving picture, or glTF in three dimensions.
        """
        from trace_dag.agents.replays import replay

        if self._stored.shown_log() is None:
            raise self._missing("log")
        return CrashReplay(replay(self._stored, replay_format), replay_format, f"Replay of crash {self.key}")

    def __repr__(self) -> str:
        return f"<Crash {self.key}>"

    def _repr_html_(self) -> str:
        from trace_dag.crash.summary import in_one_sentence
        from trace_dag.verdict.in_words import label_in_words

        said = in_one_sentence(self.record) if self.has("record") else ""
        label = label_in_words(self.verdict) if self.has("verdict") else "no verdict"
        return f"<p><b>{escape(self.key)}</b>, {escape(label)}. {escape(said)}</p>"

    def _load(self, artefact: Artefact[T], part: str) -> T:
        if not self._stored.has(artefact):
            raise self._missing(part)
        return self._stored.load(artefact)

    def _missing(self, part: str) -> UserError:
        return UserError(f"crash {self.key} has no {part.replace('_', ' ')}: it got no further; home.crashes says why")


_PARTS: dict[str, tuple[Artefact[Any], ...]] = {
    "report": (REPORT_XML, REPORT_JSON),
    "record": (RECORD,),
    "road_map": (ROAD_MAP,),
    "estimate": (ESTIMATE,),
    "verdict": (VERDICT,),
}

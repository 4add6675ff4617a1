"""The roads of the crashes."""

from trace_dag.assets.specs import stage_spec
from trace_dag.common.stage import Stage

ROADS = (
    stage_spec(
        Stage.OSM_EXTRACT,
        group="roads",
        kinds={"openstreetmap", "file"},
        deps=[Stage.CRASH_RECORD],
        description="The drivable roads of OpenStreetMap around the reported point. "
        "© OpenStreetMap contributors, ODbL 1.0.",
    ),
    stage_spec(
        Stage.ROAD_MAP,
        group="roads",
        kinds={"opendrive", "python"},
        deps=[Stage.CRASH_RECORD, Stage.OSM_EXTRACT],
        description="The road map as OpenDRIVE 1.7, with the crash's place on it, the gates it passed and how it "
        "agrees with the report.",
    ),
)

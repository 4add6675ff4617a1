"""All settings, in one place, each with its unit, default and where the default comes from.

One section per stage: a stage's provenance holds exactly its own section, so that a changed setting recomputes from its
stage on; a setting of a service or of an estimator that is not chosen recomputes nothing. Secrets (API keys) are not
settings: they are read from the environment where they are used and never stored. Does not belong here: the file and
the environment that they are read from (:mod:`trace_dag.common.settings_sources`).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from trace_dag.common.errors import UserError
from trace_dag.common.plugins import PluginKind, plugin

RuleSetName = Literal["trace-dag", "strict", "published"]

_NOT_IN_PROVENANCE: dict[str, Any] = {"provenance": False}  # says how a service is reached, not what comes out
_OF_THE_LLM: dict[str, Any] = {"provenance": {"estimator": "llm"}}  # changes nothing that another estimator makes


def _one_of(kind: PluginKind) -> AfterValidator:
    """Return a name that an installed package offers."""

    def check(name: str) -> str:
        try:
            plugin(kind, name)
        except UserError as error:
            raise ValueError(str(error)) from error
        return name

    return AfterValidator(check)


def _timezone(name: str) -> str:
    try:
        ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError) as error:
        raise ValueError("expected a time zone such as America/New_York or UTC") from error
    return name


class _Section(BaseModel):
    # A section by itself is seldom validated: built with all others, it costs start-up nothing.
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)


class CrashSettings(_Section):
    """Reading and filtering reports (stages ``raw_report`` and ``crash_record``)."""

    repair_malformed: bool = Field(False, description="Repair reports that are not well-formed, and mark them so.")
    kinds: tuple[str, ...] | None = Field(
        None, description="Kinds a crash must be of, such as two_vehicles; null takes each that can be judged."
    )
    vehicles: int | None = Field(None, description="Motor vehicles a crash must involve; null takes any number.")
    filters: dict[str, tuple[int, ...]] = Field(
        default_factory=dict,
        description="Codes a FARS element must have: LGT_COND = [1]; those of vehicles hold for each in transport.",
    )


class OsmSettings(_Section):
    """Cutting the map (stage ``osm_extract``)."""

    radius_m: float = Field(300.0, gt=0, description="Half the side of the box around the crash.")
    service_roads: bool = Field(True, description="Keep service roads and driveways.")
    surroundings_radius_m: float = Field(
        150.0, gt=0, description="Half the side of the box in which trees, poles, buildings, water and woods are kept."
    )
    node_memory_mb: float = Field(
        4000.0,
        ge=0,
        json_schema_extra={"provenance": False},
        description="Memory for the places of a map file's nodes, up to three times its size; where that is more, they "
        "lie in the temporary folder (TMPDIR).",
    )


class RoadSettings(_Section):
    """OSM to OpenDRIVE (stage ``road_map``)."""

    converter: Annotated[str, _one_of(PluginKind.CONVERTER)] = Field(
        "native",
        json_schema_extra={"plugin": PluginKind.CONVERTER},
        description="native, CARLA's osm2odr (extra carla), or one that an installed package offers.",
    )
    elevation: bool = Field(True, description="Off rejects crashes near bridges and tunnels, as the paper does.")
    vertical_geometry_radius_m: float = Field(
        100.0, description="With elevation off: a bridge, tunnel or layer this near the crash rejects it."
    )
    marks: Literal["reconstruction", "legal"] = Field(
        "reconstruction", description="Marks that allow every reported motion, or those the law paints."
    )
    gate_scope: Literal["used", "all"] = Field(
        "used",
        description="Roads for which a map is rejected: those that the crash can use (others are left out), or all.",
    )
    max_move_m: float = Field(30.0, description="How far a reported point may be moved to reach the road it names.")


class StateSettings(_Section):
    """Estimating states (stage ``state_estimate``)."""

    estimator: Annotated[str, _one_of(PluginKind.ESTIMATOR)] = Field(
        "analytic",
        json_schema_extra={"plugin": PluginKind.ESTIMATOR},
        description="What ranks the hypotheses: analytic, llm, or one that an installed package offers.",
    )
    # Bodies overlap for some 30 ms: 10 ms short of a whole second, whoever plays it in equal steps sees them do so.
    lead_time_s: float = Field(4.99, gt=0, description="Time before the impact at which the reconstruction starts.")
    max_hypotheses: int = Field(3, ge=1, description="Hypotheses kept, simulated and judged, in order.")
    reported_headings: bool = Field(
        True, description="Take reported directions of travel as evidence; FARS has none, many states have."
    )
    samples: int = Field(
        8,
        ge=0,
        le=1000,
        description="Draws of what the report leaves open (speeds, timing, masses, friction), simulated for intervals; "
        "8 add some 15 % to a run. 0 makes none.",
    )
    animal: Literal["deer", "elk", "cattle"] = Field(
        "deer", description="What a struck animal is taken to be; no report tells. Three of four fatal ones are deer."
    )
    animal_pace: Literal["walking", "trotting", "galloping"] = Field(
        "trotting", description="How a struck animal is taken to have moved; no report tells."
    )
    llm_model: str = Field(
        "gemini/gemini-3-flash-preview",
        description="Provider and model, as litellm names them.",
        json_schema_extra=_OF_THE_LLM,
    )
    llm_prompt: str = Field("segments-v1", description="Name of the prompt file.", json_schema_extra=_OF_THE_LLM)
    llm_max_attempts: int = Field(
        3, ge=1, description="Answers to one crash before the fallback.", json_schema_extra=_OF_THE_LLM
    )
    llm_fallback: Literal["analytic", "reject"] = Field(
        "analytic", description="What follows unusable answers.", json_schema_extra=_OF_THE_LLM
    )
    llm_max_output_tokens: int | None = Field(
        None,
        ge=1,
        description="Longest answer, thinking included; null leaves it to the provider.",
        json_schema_extra=_OF_THE_LLM,
    )
    llm_timeout_s: float = Field(
        120.0, gt=0, description="Longest wait for one answer.", json_schema_extra=_NOT_IN_PROVENANCE
    )
    llm_provider_attempts: int = Field(
        3, ge=1, description="Requests for one answer, if the provider fails.", json_schema_extra=_NOT_IN_PROVENANCE
    )
    llm_question_time_s: float = Field(
        140.0,
        gt=0,
        description="Longest time for one answer, all of those together. A crash whose answers took as long is not "
        "asked about again: twice this is less than execution.stage_time_limit_s.",
        json_schema_extra=_NOT_IN_PROVENANCE,
    )
    llm_budget_usd: float | None = Field(
        None,
        ge=0,
        description="Cost at which a run stops asking; null has no limit.",
        json_schema_extra=_NOT_IN_PROVENANCE,
    )
    llm_requests_per_minute: float = Field(
        60.0, gt=0, description="Over all workers of a run.", json_schema_extra=_NOT_IN_PROVENANCE
    )
    llm_ledger: str | None = Field(
        None,
        description="Runs that name the same ledger share budget and rate; null gives each run its own.",
        json_schema_extra=_NOT_IN_PROVENANCE,
    )


class SimSettings(_Section):
    """Simulation (stage ``simulation_log``)."""

    backend: Annotated[str, _one_of(PluginKind.BACKEND)] = Field(
        "embedded",
        json_schema_extra={"plugin": PluginKind.BACKEND},
        description="embedded over MuJoCo, a carla server, or one that an installed package offers.",
    )
    step_s: float = Field(0.005, ge=0.0001, le=0.05, description="Integration step.")
    log_step_s: float = Field(0.02, ge=0.001, le=1.0, description="Step of the log.")
    time_limit_s: float = Field(20.0, gt=0, le=600, description="Simulated time at which a run ends at the latest.")
    friction: float = Field(0.75, gt=0, description="Tyre-road friction, dry asphalt; scaled by VSURCOND.")
    roadside_friction: float = Field(
        0.5,
        gt=0,
        description="Of tyres beyond the carriageway, on grass, earth or gravel (0.4 to 0.7: Fricke, Traffic Crash "
        "Reconstruction, 2010); scaled by VSURCOND.",
    )
    restitution: float | None = Field(
        None, ge=0, le=1, description="Between vehicles, along the contact normal. Unset: falls with the closing speed."
    )
    contact_friction: float = Field(
        0.5,
        ge=0,
        description="Between vehicles, along the contact; 0.3 to 0.6 in sideswipes, more the deeper the crush.",
    )
    locked_wheels: float = Field(
        0.5, ge=0, le=1, description="After the impact: share of a vehicle's weight on locked wheels, the rest rolls."
    )
    person_friction: float = Field(
        0.66,
        gt=0,
        description="Of people sliding on the road, wet or dry (Searle, SAE 831622); less where it is slippery.",
    )
    reaction_s: float = Field(
        1.1,
        ge=0,
        description="Until a driver who was not braking brakes: from when a person comes into the lane, at the strike "
        "at the earliest, or from a graze (median of surprised drivers: Olson and Sivak, Human Factors 28, 1986).",
    )
    braking_share: float = Field(
        0.8,
        gt=0,
        le=1,
        description="And how hard, as a share of what tyres and road allow (0.6 g when dry: Fambro et al., "
        "NCHRP Report 400).",
    )
    crash_delta_v_mps: float = Field(
        2.2,
        gt=0,
        description="Change of velocity from which a contact ends a driver's drive: the 8 km/h from which an event "
        "data recorder records (49 CFR 563.5).",
    )
    carla_host: str = Field("127.0.0.1", description="Where the CARLA server is.", json_schema_extra=_NOT_IN_PROVENANCE)
    carla_port: int = Field(2000, description="Its port.", json_schema_extra=_NOT_IN_PROVENANCE)


class VerdictSettings(_Section):
    """Judging (stage ``verdict``). Defaults are the paper's thresholds.

    The rule set "strict" also rejects for wrong speeds, which the paper's rules do not. "published" is the published
    pipeline's procedure with its own, fixed thresholds, for comparison.
    """

    rule_set: RuleSetName = Field("trace-dag", description="Which rules judge.")
    max_contact_distance_m: float = Field(5.0, gt=0, description="First contact to the reported location.")
    max_clock_error_positions: float = Field(
        2.0, ge=0, le=6, description="Impact on each body, against the reported one."
    )
    max_direction_error_deg: float = Field(
        45.0, ge=0, le=180, description="Each turn, and the angle between the approaches, against the reported ones."
    )
    reported_headings: bool = Field(
        True, description="Ask that vehicles and people go in the directions that the report gives, where it does."
    )
    max_zone_error_m: float = Field(1.0, ge=0, description="Of a person, outside the reported zone of the road.")
    max_speed_error_rel: float = Field(0.1, ge=0, description='Against reported speeds; rejects only under "strict".')


class ServiceSettings(_Section):
    """Access to public services; never part of any provenance."""

    crashapi_url: str | None = Field(None, description="Where the CrashAPI is; null is NHTSA's own.")
    overpass_urls: tuple[str, ...] = Field((), description="Overpass endpoints, in order; empty takes public ones.")
    osm_api_url: str | None = Field(None, description="Where the OSM API is; null is OpenStreetMap's own.")
    cache_dir: str | None = Field(None, description="Folder for answers; null is cache/ in the root's local folder.")
    cache_only: bool = Field(False, description="Ask nobody: what is not in the cache fails.")
    requests_per_s: float = Field(
        2.0, gt=0, description="Requests to one service, over all processes that share the cache folder."
    )
    timeout_s: float = Field(60.0, gt=0, description="Longest wait for a service to say something.")
    attempts: int = Field(5, ge=1, description="Times a request is made before it counts as failed.")
    first_wait_s: float = Field(1.0, ge=0, description="Pause before the second attempt; doubles each time.")


class ExecutionSettings(_Section):
    """Execution of a batch; never part of any provenance."""

    executor: Literal["in_process", "processes", "dask"] = Field("processes", description="Where the work runs.")
    workers: int | None = Field(None, ge=1, le=1024, description="Processes; null is one per core.")
    chunk_size: int = Field(8, ge=1, description="Crashes handed to a worker at a time.")
    dask_address: str | None = Field(None, description="Address of a running Dask scheduler, tcp://host:port.")
    batch_size: int = Field(250, ge=1, description="Crashes in one Dagster run.")
    stage_time_limit_s: float = Field(
        300.0,
        gt=0,
        le=86_400,
        description="Longest time of a stage for a crash, after which it has failed; for cutting maps, of all crashes "
        "that share them, and a second more for each MB of the map files.",
    )
    transient_retries: int = Field(2, ge=0, description="Times a stage is tried again after a transient failure.")
    retry_wait_s: float = Field(1.0, ge=0, description="Pause before the first of those; doubles each time.")
    pictures: bool = Field(True, description="Draw a picture of each crash, up to pages_up_to crashes.")
    pages_up_to: int = Field(
        250,
        ge=0,
        description="Crashes of a root up to which a run makes pictures, packages and pages. Of more, trace-dag open, "
        "trace-dag release and the asset benchmark in the UI make them.",
    )


class Schedule(_Section):
    """Times at which outdated crashes of a cohort are run, while ``trace-dag ui`` or Dagster's daemon runs."""

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", description="What Dagster calls it.")
    cron: str = Field(description="When, as crontab says it: 0 2 * * * is every night at two.")
    timezone: Annotated[str, AfterValidator(_timezone)] = Field("UTC", description="Of these hours: America/New_York.")
    cohort: str | None = Field(None, description="Which crashes; null takes all.")


class AutomationSettings(_Section):
    """Automation and its alerts; never part of any provenance.

    The daemon reads it when it starts.
    """

    schedules: tuple[Schedule, ...] = Field((), description="Cohorts that are run at given hours.")
    run_registered: bool = Field(
        False,
        description="Whether crashes are run once the daemon sees that they were registered, by whatever command.",
    )
    new_cases_cron: str = Field("0 6 * * 1", description="When the CrashAPI is asked for newly released cases.")
    new_cases_timezone: Annotated[str, AfterValidator(_timezone)] = Field("UTC", description="Of these hours.")
    fresh_within_h: float | None = Field(
        None, gt=0, description="Age at which the UI shows the warehouse as overdue; a warning at three quarters of it."
    )
    alert_command: tuple[str, ...] = Field(
        (), description="Program and arguments that are given each alert as JSON on standard input."
    )
    site_url: str | None = Field(
        None,
        description="Where the root is served, for links to pages and pictures; null is /site of the server that "
        "trace-dag ui starts.",
    )


class WarehouseSettings(_Section):
    """Limits of a question to the warehouse (trace-dag sql); never part of any provenance."""

    query_time_s: float = Field(60.0, gt=0, le=86_400, description="Longest time until the answer.")
    query_memory_mb: int = Field(2048, ge=512, le=1_048_576, description="Address space of the process that answers.")


class Settings(_Section):
    """Settings of a run, all sections together."""

    crash: CrashSettings = CrashSettings()
    osm: OsmSettings = OsmSettings()
    roads: RoadSettings = RoadSettings()
    states: StateSettings = StateSettings()
    sim: SimSettings = SimSettings()
    verdict: VerdictSettings = VerdictSettings()
    services: ServiceSettings = ServiceSettings()
    execution: ExecutionSettings = ExecutionSettings()
    automation: AutomationSettings = AutomationSettings()
    warehouse: WarehouseSettings = WarehouseSettings()

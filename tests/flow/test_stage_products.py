"""What a stage hands on in memory is what its files say: a stage after it comes to the same whether it ran in the same
process or finds the files."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from cases import SETTINGS
from example_objects import REPORTS, made_of, record_of

from trace_dag.common.storage.files import Storage
from trace_dag.flow.cohorts.services import Services
from trace_dag.flow.stages.simulation_log import simulation_log
from trace_dag.flow.stages.state_estimate import state_estimate
from trace_dag.reconstruction.samples.simulated import samples_from_json
from trace_dag.simulation.log_io import logs_from_files
from trace_dag.simulation.states import estimate_from_json


@pytest.mark.parametrize("name", REPORTS)
def test_values_passed_on_are_those_of_the_files(name: str, tmp_path: Path) -> None:
    made, record = made_of(name), record_of(name)
    services = Services(Storage.open(str(tmp_path)), SETTINGS.services, "")
    estimated = state_estimate(record, made.network, made.map_report, SETTINGS.states, services)
    estimate = estimate_from_json(estimated.files["json"])
    np.testing.assert_equal(asdict(estimated.parsed["json"]), asdict(estimate))

    simulated = simulation_log(record, made.network, made.map_report, made.xodr, estimate, SETTINGS.sim)
    stored = logs_from_files(simulated.files["parquet"], simulated.files["json"])
    handed_on = [asdict(replace(log, wall_s=0.0)) for log in simulated.parsed["parquet"]]  # the clock is not stored
    np.testing.assert_equal(handed_on, [asdict(log) for log in stored])
    assert simulated.parsed["samples.json"] == samples_from_json(simulated.files["samples.json"])

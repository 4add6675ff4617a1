"""A run on a Dask cluster whose workers share nothing but an object store ends as one on this machine."""

from __future__ import annotations

import subprocess

from faults.cluster import BUCKET, dask_cluster, kill_when_under_way, object_store
from result_tables import differences
from sample_runs import KEYS, SAMPLE, command, finished, reports_of, trace_dag_process

from trace_dag.common.storage.files import Storage
from trace_dag.flow.stages import FLOW
from trace_dag.flow.workspace import Workspace

ROOT = f"s3://{BUCKET}/root"


def test_a_cohort_on_a_cluster_with_a_killed_worker_gives_the_tables_of_a_local_run(tmp_path, monkeypatch):
    here = finished()  # before the environment says otherwise
    with object_store() as store:
        environment = store | {"XDG_DATA_HOME": str(tmp_path / "here")}
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        reports, maps = reports_of(tmp_path / "reports"), SAMPLE / "osm"
        done = trace_dag_process(ROOT, "ingest", "--reports", str(reports), "--maps", str(maps), "--cohort", "sample")
        assert done.returncode == 0, done.stderr
        with dask_cluster(tmp_path, 2, store | {"TRACE_DAG_LOG": "INFO"}) as cluster:
            for name, value in cluster.settings().items():
                monkeypatch.setenv(name, value)
            monkeypatch.setenv("TRACE_DAG_EXECUTION__CHUNK_SIZE", "1")
            run = subprocess.Popen(command(ROOT, "run"), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            kill_when_under_way(cluster, run, Storage(ROOT))
            said, _ = run.communicate(timeout=900)
            assert run.returncode == 0, said
        assert f"{len(KEYS)} in all" in said
        warehouse = Workspace.open(ROOT, FLOW).warehouse
        assert differences(here / "warehouse.duckdb", warehouse) == {}
        done = trace_dag_process(ROOT, "verify", "--contents")
        assert done.returncode == 0, done.stdout

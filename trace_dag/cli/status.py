"""States of the crashes: ``status``."""

from __future__ import annotations

import click

from trace_dag.cli.options import examples, pass_root
from trace_dag.cli.printing import one_line, print_first, print_stale, print_statuses, say, write_json
from trace_dag.common.messages.logs import print_problem

_MOST_SHOWN = 20


@click.command(epilog=examples("trace-dag status", "trace-dag status --cohort virginia --json"))
@click.option("--json", "as_json", is_flag=True, help="Everything, each crash included, as JSON.")
@click.option("--cohort", help="Only crashes of this cohort.")
@pass_root
def status(root: str, as_json: bool, cohort: str | None) -> None:
    """Show the funnel and the state of each crash, from stored results."""
    from trace_dag.common.stage import Stage
    from trace_dag.flow.batch import stale_results
    from trace_dag.flow.crash_status import FinalState, crash_statuses, funnel
    from trace_dag.flow.records import read_records
    from trace_dag.flow.workspace import Workspace

    workspace = Workspace.open(root, to_read=True)
    storage, registry = workspace.storage, workspace.registry
    records = read_records(storage, registry.keys(cohort))
    crashes = crash_statuses(records)
    stale = {each.key: each for each in stale_results(workspace, records)}
    if not crashes and cohort is None and storage.list(Stage.RAW_REPORT.value):
        print_problem(
            "no cohort is registered, though there are results; trace-dag verify --repair registers them again"
        )
    if as_json:
        cohorts = {key: name for name, each in registry.cohorts().items() for key in each.reports}
        write_json(
            {
                "root": storage.root,
                "final_states": {
                    state.value: sum(crash.final_state is state for crash in crashes.values()) for state in FinalState
                },
                "funnel": [
                    {"step": step.step, "crashes": step.crashes, "published": step.published}
                    for step in funnel(crashes.values())
                ],
                "crashes": {
                    key: {
                        "cohort": cohorts[key],
                        "final_state": crash.final_state.value,
                        "stage_reached": crash.stage_reached.value if crash.stage_reached else None,
                        "reason": crash.reason.value if crash.reason else None,
                        "detail": crash.detail,
                        "outdated": crash.outdated.value if crash.outdated else None,
                        "outdated_because": crash.outdated_because,
                        "stale": stale[key].stage.value if key in stale else None,
                        "stale_because": list(stale[key].changed) if key in stale else [],
                        "estimator": crash.made.estimator if crash.made else None,
                        "estimator_asked": (crash.made.fallback_from or crash.made.estimator) if crash.made else None,
                    }
                    for key, crash in crashes.items()
                },
            }
        )
        return
    say(f"Storage root {storage.root}")
    print_statuses(crashes)
    failed = [
        (crash.key, crash.stage_reached, one_line(crash.detail, 200))
        for crash in crashes.values()
        if crash.final_state is FinalState.FAILED
    ]
    outdated = [
        (crash.key, crash.outdated, one_line(crash.outdated_because, 200))
        for crash in crashes.values()
        if crash.outdated
    ]
    for names, rows in (
        (["failed", "in", "what happened"], failed),
        (["outdated", "in", "why the new attempt failed"], outdated),
    ):
        if rows:
            say()
            print_first(names, rows, _MOST_SHOWN, "status --json")
    if failed or outdated:
        say("trace-dag rerun --failed runs them again.")
    if stale:
        say()
        print_stale(stale.values())

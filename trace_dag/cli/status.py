"""Where things stand: ``status``."""

from __future__ import annotations

import click

from trace_dag.cli.options import examples
from trace_dag.cli.printing import one_line, print_stale, print_standings, print_table, say, write_json
from trace_dag.logs import complain

_FAILED_SHOWN = 20


@click.command(
    epilog=examples(
        "trace-dag status",
        "trace-dag status --cohort virginia --json",
    )
)
@click.option("--json", "as_json", is_flag=True, help="Everything, each crash included, as JSON.")
@click.option("--cohort", help="Only crashes of this cohort.")
@click.pass_obj
def status(root: str, as_json: bool, cohort: str | None) -> None:
    """Show the funnel and where each crash stands, from what is stored."""
    from trace_dag.flow.batch import stale_results
    from trace_dag.flow.records import read_records
    from trace_dag.flow.standing import FinalState, funnel, standings
    from trace_dag.flow.workspace import Workspace
    from trace_dag.stage import Stage

    workspace = Workspace.open(root, to_read=True)
    storage, registry = workspace.storage, workspace.registry
    records = read_records(storage, registry.keys(cohort))
    crashes = standings(records)
    stale = {each.key: each for each in stale_results(workspace, records)}
    if not crashes and cohort is None and storage.list(Stage.RAW_REPORT.value):
        complain("no cohort is registered, though there are results; trace-dag verify --repair registers them again")
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
    print_standings(crashes)
    failed = [crash for crash in crashes.values() if crash.final_state is FinalState.FAILED]
    if failed:
        say()
        print_table(
            ["failed", "in", "what happened"],
            [(crash.key, crash.stage_reached, one_line(crash.detail, 200)) for crash in failed[:_FAILED_SHOWN]],
        )
        if len(failed) > _FAILED_SHOWN:
            say(f"... and {len(failed) - _FAILED_SHOWN} more (status --json lists all)")
    outdated = [crash for crash in crashes.values() if crash.outdated]
    if outdated:
        say()
        print_table(
            ["outdated", "in", "why the new attempt failed"],
            [(crash.key, crash.outdated, one_line(crash.outdated_because, 200)) for crash in outdated[:_FAILED_SHOWN]],
        )
        if len(outdated) > _FAILED_SHOWN:
            say(f"... and {len(outdated) - _FAILED_SHOWN} more (status --json lists all)")
    if failed or outdated:
        say("trace-dag rerun --failed runs them again.")
    if stale:
        say()
        print_stale(stale.values())

"""Coverage of a country's crashes: ``national-coverage``."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from trace_dag.cli.options import examples, pass_root
from trace_dag.cli.printing import print_table, say, write_json


@click.command(
    epilog=examples(
        "trace-dag national-coverage FARS2015-accident.zip",
        "trace-dag national-coverage FARS2015-accident.zip --cohort unseen",
    )
)
@click.argument("tables", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--cohort", "cohorts", multiple=True, help="Only the stored crashes of this cohort; all by default.")
@click.option("--json", "as_json", is_flag=True, help="Every kind, as JSON.")
@pass_root
def national_coverage(root: str, tables: tuple[Path, ...], cohorts: tuple[str, ...], as_json: bool) -> None:
    """Estimate the share of a country's fatal crashes that can be reconstructed.

    TABLES are FARS's accident tables of whole years (CSV, or ZIP archives of it). The kinds of crash are counted there,
    and each kind is given the success rate of the stored crashes of that kind. Crashes without a map are left out of
    the rate.
    """
    from trace_dag.flow.workspace import Workspace
    from trace_dag.warehouse.national import count_kinds, count_stored_kinds, coverage_of_country, thin_reports

    workspace = Workspace.open(root, to_read=True)
    chosen = [workspace.registry.cohort(name).name for name in cohorts] or sorted(workspace.registry.cohorts())
    found = coverage_of_country(count_kinds(tables), count_stored_kinds(workspace.warehouse, chosen))
    thin = thin_reports(workspace.warehouse, chosen)
    if as_json:
        write_json(asdict(found) | {"thin_reports": thin})
        return
    print_table(
        ["kind", "national", "share", "stored", "complete", "map at hand", "mapped", "verified", "comes through"],
        [
            (
                each.kind.value.replace("_", " "),
                each.national,
                f"{each.national / found.crashes:.1%}",
                each.stored.registered,
                each.stored.complete,
                each.stored.with_map_at_hand,
                each.stored.mapped,
                each.stored.verified,
                _share(each.judged, each.verified_rate),
            )
            for each in found.kinds
        ],
    )
    low, high = found.verified_bounds
    say()
    say(f"{found.two_vehicles:.1%} of {found.crashes:,} crashes are of two vehicles alone")
    say(f"{found.judged:.1%} are of kinds that are reconstructed and judged")
    say(f"{found.verified:.1%} would be verified with a map everywhere (90 % bounds {low:.1%} to {high:.1%})")
    if thin:
        registered = sum(each.stored.registered for each in found.kinds)
        say(
            f"{thin} of the {registered} stored crashes are incomplete because their tables say of no vehicle how it "
            "moved (P_CRASH1, P_CRASH2, ACC_TYPE). NHTSA's tables do: the gap is the stored tables', and it counts "
            "against the country here"
        )


def _share(judged: bool, rate: float | None) -> str:
    if not judged:
        return "not judged"
    return "no crash stored" if rate is None else f"{rate:.0%}"

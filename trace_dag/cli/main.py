"""The command ``trace-dag``: its root option, its subcommands, and how errors end it."""

from __future__ import annotations

import os
import sys

import click

from trace_dag.cli.cohort import cohort
from trace_dag.cli.controls import controls
from trace_dag.cli.demo import demo
from trace_dag.cli.evaluate import evaluate
from trace_dag.cli.export import export
from trace_dag.cli.ingest import ingest
from trace_dag.cli.leaderboard import leaderboard
from trace_dag.cli.map import map_command
from trace_dag.cli.national_coverage import national_coverage
from trace_dag.cli.options import GroupedCommands, examples
from trace_dag.cli.registers import registers
from trace_dag.cli.release import release
from trace_dag.cli.replay import replay
from trace_dag.cli.run import rerun, run
from trace_dag.cli.settings import plugins, settings
from trace_dag.cli.show import open_page, show
from trace_dag.cli.sql import find, sql, tables
from trace_dag.cli.status import status
from trace_dag.cli.traffic import traffic
from trace_dag.cli.ui import ui
from trace_dag.cli.vary import vary
from trace_dag.cli.verify import verify
from trace_dag.common.errors import Failure, UserError, UserErrors
from trace_dag.common.messages.logs import configure_logging, print_problem
from trace_dag.common.storage.disk_errors import disk_failure
from trace_dag.version import __version__

EXIT_FAILED = 1
EXIT_USAGE = 2


@click.group(
    cls=GroupedCommands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog=examples("trace-dag demo", "trace-dag --root virginia status"),
)
@click.version_option(__version__, prog_name="trace-dag")
@click.option(
    "--root",
    metavar="DIR",
    help="Storage root: a folder or a URL such as s3://bucket/folder. Else TRACE_DAG_ROOT, else ./trace_dag_home.",
)
@click.pass_context
def cli(context: click.Context, root: str | None) -> None:
    """Turn police-reported crashes into runnable, judged crash scenarios on the real road.

    Register crashes with ingest, run them, and see where each stands with status. Everything is kept below one
    storage root.
    """
    from trace_dag.flow.workspace import storage_root

    context.obj = storage_root(root)


cli.add_under("Start", demo, ingest, registers, run, rerun, cohort)
cli.add_under("Look", status, show, open_page, ui, replay, find, sql, tables)
cli.add_under("Judge the results", controls, national_coverage, verify)
cli.add_under("Use them", export, release, evaluate, leaderboard, vary, traffic)
cli.add_under("Without crashes", map_command)
cli.add_under("Set up", settings, plugins)


def main() -> None:
    """Run the command."""
    try:
        configure_logging()
        _refuse_windows()
        sys.exit(cli.main(standalone_mode=False))
    except click.ClickException as error:
        context = getattr(error, "ctx", None)  # of usage errors alone
        command = context.command_path if context is not None else "trace-dag"
        print_problem(f"{command}: {_one_line(error.format_message())} See {command} --help.")
        sys.exit(EXIT_USAGE)
    except click.exceptions.Abort:
        print_problem("interrupted; what was finished is kept, run again for the rest")
        sys.exit(130)
    except UserError as error:
        for said in error.messages if isinstance(error, UserErrors) else (str(error),):
            print_problem(f"trace-dag: {_one_line(said)}")
        sys.exit(EXIT_USAGE)
    except BrokenPipeError:
        # The reader (head, less) has had enough.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except Exception as error:
        failure = error if isinstance(error, Failure) else disk_failure(error)
        if failure is None:
            raise
        print_problem(f"trace-dag: failed: {_one_line(str(failure))}")
        sys.exit(EXIT_FAILED)


def _refuse_windows() -> None:
    """Raise UserError on Windows, which lacks the POSIX locks and limits that runs need."""
    if sys.platform == "win32":
        raise UserError(
            "this program runs on Linux and macOS; on Windows it runs in WSL 2 (wsl --install, then install it there). "
            "Packages, pages and exported scenarios open on Windows as they are"
        )


def _one_line(text: str) -> str:
    return " ".join(text.split())

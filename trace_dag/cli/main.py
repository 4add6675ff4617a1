"""The command ``trace-dag``: its root option, its subcommands, and how errors end it."""

from __future__ import annotations

import os
import sys

import click

from trace_dag.cli.options import GroupedCommands, examples
from trace_dag.common.errors import Failure, UserError, UserErrors
from trace_dag.common.messages.logs import configure_logging, print_problem
from trace_dag.common.storage.disk_errors import disk_failure
from trace_dag.version import __version__

EXIT_FAILED = 1
EXIT_USAGE = 2


_COMMANDS = {
    "Start": {
        "demo": "demo:demo",
        "ingest": "ingest:ingest",
        "registers": "registers:registers",
        "run": "run:run",
        "rerun": "run:rerun",
        "cohort": "cohort:cohort",
    },
    "Look": {
        "status": "status:status",
        "show": "show:show",
        "open": "show:open_page",
        "ui": "ui:ui",
        "replay": "replay:replay",
        "find": "sql:find",
        "sql": "sql:sql",
        "tables": "sql:tables",
    },
    "Judge the results": {
        "controls": "controls:controls",
        "national-coverage": "national_coverage:national_coverage",
        "verify": "verify:verify",
    },
    "Use them": {
        "export": "export:export",
        "release": "release:release",
        "evaluate": "evaluate:evaluate",
        "leaderboard": "leaderboard:leaderboard",
        "vary": "vary:vary",
        "traffic": "traffic:traffic",
    },
    "Without crashes": {"map": "map:map_command"},
    "Set up": {"settings": "settings:settings", "plugins": "settings:plugins"},
}
"""The commands by heading of the help, each with its module here and its function."""


@click.group(
    cls=GroupedCommands,
    commands_by_heading=_COMMANDS,
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


def main(program: str | None = None) -> None:
    """Run the command; ``program`` is its name in messages, by default that of the process."""
    try:
        configure_logging()
        _refuse_windows()
        sys.exit(cli.main(prog_name=program, standalone_mode=False))
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

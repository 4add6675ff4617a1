"""The command line: a thin layer over the flow and over Dagster.

Exit codes: 0 done, 1 some crashes failed, 2 the command cannot be carried out (one line has the reason). Each module is
named after its command; what is slow to import is imported inside the command that needs it.
"""

from trace_dag.cli.main import main

__all__ = ["main"]

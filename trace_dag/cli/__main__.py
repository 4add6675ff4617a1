"""``python -m trace_dag.cli``."""

from trace_dag.cli.main import main

if __name__ == "__main__":
    main()

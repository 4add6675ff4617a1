"""Commands in processes of their own that need not read the program's modules first.

Reading them takes one to two seconds of a processor, and the tests start hundreds of commands. One process for each
worker of pytest reads them once and forks for each command, which gets the words, the environment, the folder and the
open files of whoever asks. A signal sent to who asks does not reach the command: tests of signals start it as a shell
would (:func:`sample_runs.command`), and so do those of starting itself.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import pkgutil
import select
import signal
import socket
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

import trace_dag

_STARTED: list[subprocess.Popen[bytes]] = []  # its standard input is a pipe of this process: it ends when this does
PROGRAMS = {
    "trace-dag": "from trace_dag.cli.main import main\nmain()",
    "python": "import sys\n"
    "if sys.argv[1:3] == ['-m', 'lab']:\n"
    "    del sys.argv[1:3]\n    from lab.__main__ import main\n    main()\n"
    "else:\n    exec(sys.stdin.read())",
}

_IMPORTED_WHERE_USED = (
    "mujoco",
    "pandas",
    "pyarrow.parquet",
    "pyproj.crs",
    "upath.implementations.local",
)

# What stands for the program where a shell looks for it; without the site's packages it starts in no time.
_ASKS = """#!{python} -IS
import json, os, socket, sys
with socket.socket(socket.AF_UNIX) as prepared:
    prepared.connect({address!r})
    words = json.dumps([sys.argv, os.getcwd(), dict(os.environ)]).encode("ascii")
    socket.send_fds(prepared, [len(words).to_bytes(8, "big")], [0, 1, 2])
    prepared.sendall(words)
    sys.exit(int(prepared.recv(8)))
"""


@cache
def programs() -> Path:
    """Return the folder with ``trace-dag``, and ``python`` for ``-m lab`` and for a program on its standard input."""
    folder = Path(tempfile.mkdtemp(prefix="prepared-", dir=os.environ.get("TRACE_DAG_TESTS_SHARED")))
    address = str(folder / "asked")
    for name in PROGRAMS:
        program = folder / name
        program.write_text(_ASKS.format(python=sys.executable, address=address))
        program.chmod(0o755)
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(address)
        listening.listen()
        words = [sys.executable, __file__, str(listening.fileno())]
        _STARTED.append(subprocess.Popen(words, stdin=subprocess.PIPE, pass_fds=[listening.fileno()]))
    return folder


def serve(listening: socket.socket) -> None:
    """Until standard input ends: a process for each command, and one that waits for it and says how it ended."""
    import_all()
    gc.freeze()  # no command goes through the modules for garbage
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while listening in select.select([listening, sys.stdin], [], [])[0]:
        asked, _ = listening.accept()
        if os.fork() == 0:
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            listening.close()
            command = os.fork()
            if command == 0:
                run_command(asked)
                return
            _, status = os.waitpid(command, 0)
            asked.sendall(str(os.waitstatus_to_exitcode(status)).encode())
            os._exit(0)
        asked.close()


def import_all() -> None:
    """Our modules, and what they and Dagster import and read only where it is used.

    Nothing of it at the top of this module, which processes that a command spawns read again.
    """
    import read_revisions_once  # noqa: F401 - for what it does
    from dagster import DagsterInstance

    for module in pkgutil.walk_packages(trace_dag.__path__, "trace_dag."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    for name in _IMPORTED_WHERE_USED:
        importlib.import_module(name)
    with DagsterInstance.local_temp():
        pass


def run_command(asked: socket.socket) -> None:
    """Be the command that was asked for; ends the process as the command does."""
    head, files, _, _ = socket.recv_fds(asked, 8, 3)
    with asked, asked.makefile("rb") as rest:
        words, folder, environment = json.loads(rest.read(int.from_bytes(head, "big")))
    for number, file in enumerate(files):
        os.dup2(file, number)
        os.close(file)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv[:] = words
    name = Path(words[0]).name
    sys.path[0] = str(Path(words[0]).parent) if name == "trace-dag" else ""
    sys.path[1:1] = [name for name in environment.get("PYTHONPATH", "").split(os.pathsep) if name]
    exec(PROGRAMS[name], {"__name__": "__main__"})


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])))

"""Namespaces around an agent's process: no network, no other process, of the files only what it needs, unchangeable.

The tools are those of util-linux (``unshare``, ``mount``, ``pivot_root``, ``setpriv``), which every usual Linux has;
the kernel has to allow user namespaces. See namespaces(7).
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from trace_dag.common.errors import UserError

_TOOLS = ("unshare", "mount", "umount", "pivot_root", "setpriv")
_SYSTEM = (
    "/usr",
    "/bin",
    "/sbin",
    "/lib",
    "/lib32",
    "/lib64",
    "/etc/ld.so.cache",
    "/etc/alternatives",
    "/etc/localtime",
)
_DEVICES = ("/dev/null", "/dev/zero", "/dev/urandom", "/dev/random")
_KEPT = ("PATH", "LANG", "LC_ALL", "PYTHONPATH", "VIRTUAL_ENV", "LD_LIBRARY_PATH", "TZ")
_KEPT_BEGINNINGS = ("OMP_", "OPENBLAS_", "MKL_")

# A new root of the paths named before "--hide", read-only, with empty folders in the place of those named after it;
# then the command after "--", without any capability. It is made where /sys was: nobody keeps files there.
_SETUP = r"""
set -eu
here=$(pwd -P)
new=/sys
mount -t tmpfs -o size=256m,mode=755 agent "$new"
mkdir "$new/proc" "$new/dev" "$new/.old"
while [ "$1" != --hide ]; do
  if [ -d "$1" ]; then mkdir -p "$new$1"; else mkdir -p "$new${1%/*}"; : > "$new$1"; fi
  mount --rbind "$1" "$new$1"
  case "$1" in /dev/*) ;; *) mount -o remount,bind,ro "$new$1" ;; esac
  shift
done
shift
while [ "$1" != -- ]; do
  if [ -d "$new$1" ]; then mount -t tmpfs -o size=1m,ro nothing "$new$1"; fi
  shift
done
shift
mount -t proc proc "$new/proc"
echo 0 > "$new/proc/sys/user/max_user_namespaces"  # none within this one, where it would have all rights again
mkdir -p "$new/tmp" "$new$here"
cd "$new"
pivot_root . .old
umount -l /.old
rmdir /.old
cd "$here"
exec setpriv --no-new-privs --inh-caps=-all --bounding-set=-all -- "$@"
"""


@dataclass(frozen=True)
class Isolation:
    """``hidden``: folders an agent must not even read, such as the storage root; those that are not there are fine."""

    hidden: tuple[str, ...] = ()

    def command(self, command: Sequence[str]) -> list[str]:
        """Return a command that runs the given one in namespaces of its own."""
        kinds = ("--user", "--map-root-user", "--mount", "--pid", "--net", "--ipc", "--uts", "--cgroup")
        return [
            *("unshare", *kinds, "--fork", "--kill-child=KILL"),
            *("sh", "-c", _SETUP, "agent", *_readable(), "--hide", *self.hidden, "--", *command),
        ]

    def environment(self, variables: Mapping[str, str]) -> dict[str, str]:
        """Return the environment of an isolated agent: no variable that can hold a key or password."""
        kept = {name: value for name, value in variables.items() if name in _KEPT or name.startswith(_KEPT_BEGINNINGS)}
        return {**kept, "HOME": "/tmp", "TMPDIR": "/tmp", "PYTHONDONTWRITEBYTECODE": "1"}  # noqa: S108 - its own


@cache
def isolation(*hidden: str) -> Isolation:
    """Return the isolation that this machine offers; the result is cached.

    Raises :class:`UserError` that names the missing tools.
    """
    missing = [tool for tool in _TOOLS if shutil.which(tool) is None]
    if sys.platform != "linux" or missing:
        what = f"{' and '.join(missing)} of util-linux" if sys.platform == "linux" else "the namespaces of Linux"
        raise UserError(f"--isolate needs {what}; without them run agents of strangers in a machine of their own")
    found = Isolation(hidden)
    done = subprocess.run(  # noqa: S603 - our own command
        found.command([sys.executable, "-c", "pass"]), capture_output=True, text=True, check=False, timeout=60
    )
    if done.returncode:
        said = " ".join(done.stderr.split())[:300]
        raise UserError(
            f"--isolate is not possible here: {said or f'exit code {done.returncode}'}; the kernel has to allow user "
            "namespaces (sysctl kernel.unprivileged_userns_clone, user.max_user_namespaces), also inside a container"
        )
    return found


def _readable() -> list[str]:
    """Return the paths an agent may read: system libraries, Python, importable modules, and its working folder."""
    wanted = [*_SYSTEM, sys.base_prefix, sys.prefix, *(path for path in sys.path if path), str(Path.cwd()), *_DEVICES]
    there = [os.path.abspath(path) for path in wanted if Path(path).exists()]  # noqa: PTH100 - links stay as they are
    found: list[str] = []
    for path in sorted(dict.fromkeys(there), key=len):
        if path != "/" and not any(path == each or path.startswith(each + "/") for each in found):
            found.append(path)
    return found

"""Steps that never end, end their process or eat memory cost themselves alone."""

from __future__ import annotations

import multiprocessing
import os
import sys
from dataclasses import dataclass

from trace_dag.common.errors import Failure
from trace_dag.flow.pool import Lost, Pool, Task


@dataclass(frozen=True)
class Work:
    data: bytes = b""

    def prepare(self, name: str) -> str:
        if name == "broken":
            raise Failure("broken cannot be prepared")
        return name

    def do(self, shared: str, step: str) -> str:
        while step == "loop":
            pass
        if step == "exit":
            os._exit(3)
        if step == "eat":
            try:
                bytearray(2**40)
            except MemoryError:
                return "no memory"
        return f"{shared}/{step}"


def test_every_step_is_answered_whatever_others_do():
    pool: Pool[str, str, str] = Pool(Work(), workers=2, step_limit_s=3.0, memory_mb=512)
    tasks = [Task("a", ("x", "loop", "y")), Task("b", ("exit", "x")), Task("c", ("eat", "x")), Task("d", ())]
    answers = {(each.task, each.step): each.result for each in pool.run(tasks)}
    assert answers.pop(("a", "loop")) == Lost("took longer than 3 s")
    assert answers.pop(("b", "exit")) == Lost("ended its process (exit code 3)")
    assert answers == {
        ("a", "x"): "a/x",
        ("a", "y"): "a/y",
        ("b", "x"): "b/x",
        ("c", "eat"): "no memory",
        ("c", "x"): "c/x",
    }


def test_a_failed_preparation_is_a_failure():
    pool: Pool[str, str, str] = Pool(Work(), workers=1, step_limit_s=3.0, memory_mb=512)
    (answer,) = pool.run([Task("broken", ("x",))])
    assert isinstance(answer.result, Failure)
    assert "cannot be prepared" in str(answer.result)


def test_a_process_that_dies_as_it_starts_is_not_waited_for(tmp_path):
    python = tmp_path / "python"
    python.write_text(f'#!/bin/sh\ncase "$*" in *spawn_main*) exit 3;; esac\nexec {sys.executable} "$@"\n')
    python.chmod(0o755)
    more_than_a_pipe_holds = Work(bytes(2**20))
    pool: Pool[str, str, str] = Pool(more_than_a_pipe_holds, workers=1)
    multiprocessing.set_executable(str(python))
    try:
        (answer,) = pool.run([Task("a", ("x",))])
    finally:
        multiprocessing.set_executable(sys.executable)
    assert answer.result == Lost("ended its process (exit code 3)")

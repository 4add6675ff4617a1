"""Messages between an agent's process and the one that measures, each preceded by its length.

Messages to the agent are pickled by this program. Nothing that comes from an agent is unpickled or evaluated: an
answer is JSON, and is then checked like any other answer."""

from __future__ import annotations

import json
import math
import struct
import traceback
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from trace_dag.agents.evaluation.agents import Action, AgentFault, Motion, Recorded
from trace_dag.simulation.driving import Pedals

MOST_PATH_POINTS = 10_000
FARTHEST_M = 1e6
"""Limit of a path's points from the crash: farther than any road leads, and near enough for exact geometry."""

MESSAGE_CHARACTERS = 400
LENGTH = struct.Struct("<I")
READY = b'{"ready": true}'
NO_ANSWER = "answered bytes that are not an answer"


def add_length(message: bytes) -> bytes:
    """Return a message with its length before it.

    >>> add_length(b"abc")
    b'\\x03\\x00\\x00\\x00abc'
    """
    return LENGTH.pack(len(message)) + message


def answer_to_bytes(action: object) -> bytes:
    """Return an agent's answer as JSON, or the fault that it has.

    >>> answer_to_bytes(Pedals(brake=1.0))
    b'{"pedals": {"steer_rad": 0.0, "throttle": 0.0, "brake": 1.0, "reverse": false}}'
    """
    problem = problem_of(action)
    if problem:
        return fault_to_bytes(problem)
    given = asdict(action)  # type: ignore[call-overload]
    return json.dumps({type(action).__name__.lower(): given}, default=_as_python).encode()


def answer_from_bytes(data: bytes) -> Action:
    """Read an answer written by :func:`answer_to_bytes`.

    Raises :class:`AgentFault` for any other content, and for a fault reported by the agent's process.
    """
    try:
        ((kind, given),) = json.loads(data).items()
        if kind == "recorded":
            return Recorded(**given)
        if kind == "pedals":
            return Pedals(**given)
        if kind == "motion":
            path = given.pop("path_m")
            return Motion(**given, path_m=None if path is None else np.array(path, float))
        fault = one_line(given["what"]) if kind == "fault" else NO_ANSWER
    except (ValueError, TypeError, AttributeError, LookupError, RecursionError, OverflowError) as error:
        raise AgentFault(NO_ANSWER) from error
    raise AgentFault(fault or "failed and did not say why")


def fault_to_bytes(text: str) -> bytes:
    """Write a fault of an agent's process."""
    return json.dumps({"fault": {"what": text}}).encode()


def _as_python(value: object) -> object:
    """Return numbers and arrays of NumPy as JSON has them."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else float(value)  # type: ignore[arg-type]


def problem_of(action: object) -> str:
    """Return the fault in an answer, or "" if there is none."""
    if isinstance(action, Pedals):
        return _problem_of_numbers(action, _OF_PEDALS) or _problem_of_reverse(action.reverse)
    if isinstance(action, Motion):
        given = [name for name in _OF_MOTION if getattr(action, name) is not None]
        return _problem_of_numbers(action, given) or _problem_of_motion(action)
    if isinstance(action, Recorded):
        return _problem_of_numbers(action, ["pace"]) or _problem_of_pace(action.pace)
    return f"answered {type(action).__name__}; expected Pedals, Motion or Recorded"


def _problem_of_reverse(value: object) -> str:
    return "" if isinstance(value, bool | np.bool_) else f"Pedals.reverse is {type(value).__name__}; expected a bool"


def _problem_of_pace(value: float) -> str:
    return "" if value >= 0 else f"Recorded.pace is {value}; expected 0 or more"


_OF_PEDALS = ("steer_rad", "throttle", "brake")
_OF_MOTION = ("target_speed_mps", "acceleration_mps2", "steer_rad")


def _problem_of_numbers(action: Pedals | Motion | Recorded, names: Sequence[str]) -> str:
    for name in names:
        value: object = getattr(action, name)
        if type(value) is float and math.isfinite(value):
            continue
        what = f"{type(action).__name__}.{name}"
        if not isinstance(value, int | float | np.floating | np.integer):
            return f"{what} is {type(value).__name__}; expected a number"
        try:
            finite = math.isfinite(value)
        except OverflowError:  # an int that no float can hold
            return f"{what} is beyond any float; expected a finite number"
        if not finite:
            return f"{what} is {value}; expected a finite number"
    return ""


def _problem_of_motion(action: Motion) -> str:
    if action.target_speed_mps is not None and action.acceleration_mps2 is not None:
        return "Motion has a target speed and an acceleration; expected one of them"
    if action.target_speed_mps is not None and action.target_speed_mps < 0:
        return f"Motion.target_speed_mps is {action.target_speed_mps}; expected 0 or more"
    path = action.path_m
    if path is None:
        return ""
    if not isinstance(path, np.ndarray) or path.ndim != 2 or path.shape[1] != 2 or path.dtype.kind not in "fi":
        return "Motion.path_m is not an array of numbers of shape (n, 2)"
    if len(path) > MOST_PATH_POINTS:
        return f"Motion.path_m has {len(path)} points; at most {MOST_PATH_POINTS} are taken"
    if not np.isfinite(path).all():
        return "Motion.path_m holds a value that is not finite"
    if path.size and float(np.abs(path).max()) > FARTHEST_M:
        return f"Motion.path_m leads more than {FARTHEST_M / 1000:g} km away"
    return ""


def describe_exception(error: BaseException) -> str:
    """Return an agent's exception in one line, with the last line of code that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({frames[-1].name}, line {frames[-1].lineno})" if frames else ""
    try:
        said = str(error)
    except BaseException as worse:
        said = f"cannot be shown, {type(worse).__name__}"
    text = f"{type(error).__name__}: {said}" if said else type(error).__name__
    return one_line(text) + where


def one_line(text: str) -> str:
    r"""Return text of an agent as it can be shown anywhere.

    One line, nothing that moves a terminal's cursor, not too long.

    >>> one_line("no\nplan \x1b[2J")
    'no plan ?[2J'
    """
    shown = "".join(each if each.isprintable() else "?" for each in " ".join(text[: 10 * MESSAGE_CHARACTERS].split()))
    return shown[:MESSAGE_CHARACTERS]

"""What goes between an agent's process and the one that measures: observations there, answers back, as plain bytes.

Numbers are little-endian doubles. Nothing that comes from an agent is unpickled or evaluated: an answer is a letter for
its kind and numbers, read by a fixed layout and then checked like any other answer.
"""

from __future__ import annotations

import math
import socket
import struct
import traceback
from collections.abc import Sequence
from dataclasses import fields
from operator import attrgetter

import numpy as np

from trace_dag.evaluation.agents import Action, AgentFault, Motion, Observation, OwnState, Recorded, RoadUser
from trace_dag.geometry import FloatArray
from trace_dag.sim.driving import Pedals
from trace_dag.sim.types import BodyKind

MOST_PATH_POINTS = 10_000
FARTHEST_M = 1e6
"""Of a point of a path from the crash: farther than any road leads, and near enough for exact geometry."""

MESSAGE_CHARACTERS = 400
_LENGTH = struct.Struct("<I")
_SEEN, _OTHER = struct.Struct("<9dI"), struct.Struct("<qB7d")
# What is sent has the order of the fields, in which it is put together again.
_OWN = attrgetter(*(field.name for field in fields(OwnState)))
_SEEN_OF_OTHER = attrgetter(*(field.name for field in fields(RoadUser) if field.name not in ("number", "kind")))
_PEDALS, _MOTION = struct.Struct("<3d?"), struct.Struct("<3dB")
_NO_PATH, _SAME_PATH, _NEW_PATH = range(3)
_KINDS = tuple(BodyKind)
_KIND_NUMBERS = {kind: number for number, kind in enumerate(_KINDS)}


# --- messages ---------------------------------------------------------------------------------------------------------
def framed(message: bytes) -> bytes:
    """A message with its length before it.

    >>> length_of(framed(b"abc"))
    3
    """
    return _LENGTH.pack(len(message)) + message


def length_of(head: bytes | bytearray) -> int | None:
    """The length that begins a framed message; None while too little of it has come."""
    return int(_LENGTH.unpack_from(head)[0]) if len(head) >= _LENGTH.size else None


HEAD_BYTES = _LENGTH.size


def received(connection: socket.socket) -> bytes:
    """The next message, in however many parts it comes. Raises :class:`EOFError` once the other side is gone."""
    data = bytearray()
    while (length := length_of(data)) is None or len(data) < HEAD_BYTES + length:
        part = connection.recv(1 << 18 if data else 4096)
        if not part:
            raise EOFError
        data += part
    return bytes(data[HEAD_BYTES:])


# --- observations -----------------------------------------------------------------------------------------------------
def observation_to_bytes(seen: Observation) -> bytes:
    """An observation for an agent's process."""
    head = _SEEN.pack(seen.time_s, *_OWN(seen.own), len(seen.others))
    return head + b"".join(
        _OTHER.pack(other.number, _KIND_NUMBERS[other.kind], *_SEEN_OF_OTHER(other)) for other in seen.others
    )


def observation_from_bytes(data: bytes) -> Observation:
    """What :func:`observation_to_bytes` wrote."""
    time_s, *own, _ = _SEEN.unpack_from(data)
    others = tuple(
        RoadUser(number, _KINDS[kind], *rest) for number, kind, *rest in _OTHER.iter_unpack(data[_SEEN.size :])
    )
    return Observation(time_s, OwnState(*own), others)


# --- answers ----------------------------------------------------------------------------------------------------------
class AnswerWriter:
    """Writes the answers of one agent; a path that is the one before is not written again."""

    def __init__(self) -> None:
        self._path: bytes | None = None

    def to_bytes(self, action: object) -> bytes:
        """An answer, or what is wrong with it."""
        problem = problem_of(action)
        if problem:
            return fault_to_bytes(problem)
        if isinstance(action, Pedals):
            return b"P" + _PEDALS.pack(action.steer_rad, action.throttle, action.brake, bool(action.reverse))
        if isinstance(action, Motion):
            numbers = (action.target_speed_mps, action.acceleration_mps2, action.steer_rad)
            how, path = _NO_PATH, b""
            if action.path_m is not None:
                path = np.ascontiguousarray(action.path_m, "<f8").tobytes()
                how = _SAME_PATH if path == self._path else _NEW_PATH
                self._path = path
            head = _MOTION.pack(*(math.nan if number is None else number for number in numbers), how)
            return b"M" + head + (path if how == _NEW_PATH else b"")
        return b"R"


class AnswerReader:
    """Reads the answers of one agent, which may be anything."""

    def __init__(self) -> None:
        self._path: FloatArray | None = None

    def from_bytes(self, data: bytes) -> Action:
        """An answer. Raises :class:`AgentFault` for bytes that are none, and with what the agent's process found."""
        kind, rest = data[:1], data[1:]
        if kind == b"R" and not rest:
            return Recorded()
        if kind == b"P" and len(rest) == _PEDALS.size:
            return Pedals(*_PEDALS.unpack(rest))
        if kind == b"M" and len(rest) >= _MOTION.size:
            *numbers, how = _MOTION.unpack_from(rest)
            speed, acceleration, steer = (None if math.isnan(number) else number for number in numbers)
            return Motion(speed, acceleration, steer, self._path_of(how, rest[_MOTION.size :]))
        if kind == b"F":
            raise AgentFault(one_line(rest.decode(errors="replace")) or "failed and did not say why")
        raise AgentFault("answered bytes that are not an answer")

    def _path_of(self, how: int, data: bytes) -> FloatArray | None:
        if how == _NEW_PATH and data and len(data) % 16 == 0:
            self._path = np.frombuffer(data, "<f8").reshape(-1, 2)
        elif how not in (_NO_PATH, _SAME_PATH) or data:
            raise AgentFault("answered bytes that are not an answer")
        return None if how == _NO_PATH else self._path


def fault_to_bytes(text: str) -> bytes:
    """What went wrong in an agent's process."""
    return b"F" + text.encode(errors="replace")


def problem_of(action: object) -> str:
    """What is wrong with an answer; empty if nothing."""
    if isinstance(action, Pedals):
        return _problem_of_numbers(action, _OF_PEDALS) or _problem_of_reverse(action.reverse)
    if isinstance(action, Motion):
        given = [name for name in _OF_MOTION if getattr(action, name) is not None]
        return _problem_of_numbers(action, given) or _problem_of_motion(action)
    if isinstance(action, Recorded):
        return ""
    return f"answered {type(action).__name__}; expected Pedals, Motion or Recorded"


def _problem_of_reverse(value: object) -> str:
    return "" if isinstance(value, bool | np.bool_) else f"Pedals.reverse is {type(value).__name__}; expected a bool"


_OF_PEDALS = ("steer_rad", "throttle", "brake")
_OF_MOTION = ("target_speed_mps", "acceleration_mps2", "steer_rad")


def _problem_of_numbers(action: Pedals | Motion, names: Sequence[str]) -> str:
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


def described(error: BaseException) -> str:
    """An agent's exception in one line: what it was, and the last line of code it came through."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({frames[-1].name}, line {frames[-1].lineno})" if frames else ""
    try:
        said = str(error)
    except BaseException as worse:
        said = f"cannot be shown, {type(worse).__name__}"
    text = f"{type(error).__name__}: {said}" if said else type(error).__name__
    return one_line(text) + where


def one_line(text: str) -> str:
    r"""Text of an agent as it can be shown anywhere: one line, nothing that moves a terminal's cursor, not too long.

    >>> one_line("no\nplan \x1b[2J")
    'no plan ?[2J'
    """
    shown = "".join(each if each.isprintable() else "?" for each in " ".join(text[: 10 * MESSAGE_CHARACTERS].split()))
    return shown[:MESSAGE_CHARACTERS]

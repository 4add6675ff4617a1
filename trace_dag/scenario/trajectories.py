"""The log of a package as one JSON document, written and read: ``trajectories.json``.

It has the meaning of its columns, the states of each party per step, contacts, objects, and how the run ended. Numbers
are rounded to the micrometre (and microradian, and microsecond).
"""

from __future__ import annotations

import json
from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from trace_dag.common.errors import DamagedFile
from trace_dag.simulation.log_io import SIMULATION_STEPS
from trace_dag.simulation.objects import FixedObject
from trace_dag.simulation.types import Body, Contact, SimulationLog, Termination, VehicleLog

_DECIMALS = 6
_COLUMNS = [field.name for field in fields(VehicleLog) if field.name != "number"]
_FRAME = "x east, y north of the reported point, headings counter-clockwise from east, time from the start"


def log_to_json(key: str, log: SimulationLog) -> bytes:
    """Return a log as UTF-8 JSON, ending with a newline; equal logs give equal bytes.

    ``key`` is the crash's.

    >>> json.loads(log_to_json(record.key, log))["run"]["parties"]
    [1, 2]
    """
    meanings = {column.name: column for column in SIMULATION_STEPS.columns}
    document = {
        "key": key,
        "frame": _FRAME,
        "columns": {
            name: {"meaning": meanings[name].meaning, "unit": meanings[name].unit or None} for name in _COLUMNS
        },
        "run": {
            "backend": log.backend,
            "backend_version": log.backend_version,
            "step_s": log.step_s,
            "duration_s": _short(log.duration_s),
            "termination": str(log.termination),
            "reason": log.reason,
            "parties": [vehicle.number for vehicle in log.vehicles],
        },
        "vehicles": {
            str(vehicle.number): {
                "body": _plain(log.bodies[vehicle.number]),
                **{name: (getattr(vehicle, name).round(_DECIMALS) + 0.0).tolist() for name in _COLUMNS},
            }
            for vehicle in log.vehicles
        },
        "contacts": [_plain(contact) for contact in log.contacts],
        **({"objects": [_plain(item) for item in log.objects]} if log.objects else {}),
    }
    return (json.dumps(document, sort_keys=True, ensure_ascii=False, separators=(",", ":")) + "\n").encode()


def log_from_json(data: bytes, *, name: str) -> SimulationLog:
    """Return the log in a document of :func:`log_to_json`.

    Raises :class:`DamagedFile`, which names the file ``name``, for other content.
    """
    try:
        document: dict[str, Any] = json.loads(data)
        run, parties = document["run"], document["vehicles"]
        return SimulationLog(
            backend=run["backend"],
            backend_version=run["backend_version"],
            step_s=run["step_s"],
            vehicles=tuple(_party(number, parties[str(number)]) for number in run["parties"]),
            contacts=_adapter(Contact).validate_python(document["contacts"]),
            bodies={
                int(number): _adapter(Body).validate_python((party["body"],))[0] for number, party in parties.items()
            },
            termination=Termination(run["termination"]),
            reason=run["reason"],
            duration_s=run["duration_s"],
            objects=_adapter(FixedObject).validate_python(document.get("objects", ())),
        )
    except (ValueError, KeyError, TypeError, AttributeError, ValidationError) as error:
        what = f"it lacks {error}" if isinstance(error, KeyError) else " ".join(str(error).split())
        raise DamagedFile(name, f"not the motion of a package of this version ({what})", "export it again") from error


def _party(number: int, party: dict[str, Any]) -> VehicleLog:
    states = {name: np.array(party[name], float) for name in _COLUMNS}
    states["landmarks_m"] = states["landmarks_m"].reshape(len(states["time_s"]), -1)
    return VehicleLog(number=number, **states)


@cache
def _adapter(of: type) -> TypeAdapter[Any]:
    return TypeAdapter(tuple[of, ...])  # type: ignore[valid-type] # a class that is chosen when it runs


def _plain(value: object) -> object:
    """Return a dataclass or numbers as plain values for JSON, rounded."""
    if hasattr(value, "__dataclass_fields__"):
        return {name: _plain(getattr(value, name)) for name in value.__dataclass_fields__}
    if isinstance(value, (tuple, list)):
        return [_plain(each) for each in value]
    return _short(value) if isinstance(value, float) else value


def _short(value: float) -> float:
    return round(value, _DECIMALS) + 0.0

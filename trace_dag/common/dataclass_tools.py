"""Dataclasses as JSON and back, and copied.

Pydantic's type adapters are each made when first used. Copies of frozen dataclasses take a fraction of the time of
:func:`dataclasses.replace`: tables have many rows.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from pydantic import TypeAdapter

T = TypeVar("T")


def json_adapter(kind: type[T]) -> TypeAdapter[T]:
    """Return the type adapter of a dataclass, the same one every time.

    >>> from trace_dag.common.geometry import Pose
    >>> json_adapter(Pose).dump_json(Pose(1.0, 2.0, 0.5))
    b'{"x_m":1.0,"y_m":2.0,"heading_rad":0.5,"z_m":0.0}'
    """
    return _adapter(kind)  # type: ignore[arg-type] # every class is hashable


@cache
def _adapter(kind: type) -> TypeAdapter[Any]:
    from pydantic import TypeAdapter

    return TypeAdapter(kind)


def replace(instance: T, **changes: Any) -> T:
    """Return a copy with other values in some fields; for classes without slots and ``__post_init__``.

    It skips the initialiser, which would set every field.

    >>> replace(record, hour=7).hour, replace(record, hour=7).key
    (7, '2023-319003')
    """
    names = type(instance).__dataclass_fields__  # type: ignore[attr-defined]
    if unknown := changes.keys() - names.keys():
        raise TypeError(f"{type(instance).__name__} has no field {min(unknown)}")
    values = instance.__dict__
    copy = object.__new__(type(instance))
    copy.__dict__.update({name: values[name] for name in names} | changes)
    return copy

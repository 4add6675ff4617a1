"""Dataclasses as JSON and back: pydantic's type adapters, each made when it is first used."""

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

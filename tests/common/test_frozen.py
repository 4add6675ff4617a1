"""Copies of frozen dataclasses: as the standard library makes them."""

from __future__ import annotations

import dataclasses
from functools import cached_property

import pytest

from trace_dag.common.dataclass_tools import replace


@dataclasses.dataclass(frozen=True)
class _Car:
    wheels: int
    name: str = ""

    @cached_property
    def axles(self) -> int:
        return self.wheels // 2


def test_a_copy_has_the_changed_fields_and_computes_its_properties_anew() -> None:
    car = _Car(4, "a")
    assert car.axles == 2
    copy = replace(car, wheels=6)
    assert (copy, copy.axles, hash(copy)) == (dataclasses.replace(car, wheels=6), 3, hash(_Car(6, "a")))
    assert car == _Car(4, "a")


def test_a_field_that_is_not_there_is_refused() -> None:
    with pytest.raises(TypeError, match="_Car has no field doors"):
        replace(_Car(4), doors=2)

"""Inputs of the stages: named after earlier artefacts, annotated with their types."""

from __future__ import annotations

import inspect
from collections.abc import Callable

import pytest

from trace_dag.common.plugins import resolve_reference, signature_of
from trace_dag.common.settings import Settings
from trace_dag.common.stage import Stage
from trace_dag.flow.stages import FLOW


def returned_by(reader: Callable[..., object]) -> str:
    """The name of the type that a function returns, of a class method also where that is its own class."""
    annotation = inspect.signature(reader).return_annotation
    return reader.__self__.__name__ if annotation == "Self" else annotation


@pytest.mark.parametrize("definition", FLOW.stages, ids=lambda definition: definition.stage)
def test_parameters_have_the_types_of_what_they_are_named_after(definition):
    """Parameters are given by name: one that is annotated as something else would be given the wrong thing."""
    for parameter in signature_of(definition.function).parameters:
        annotation = parameter.annotation
        if parameter.name == "settings":
            assert annotation in {info.annotation.__name__ for info in Settings.model_fields.values()}
        elif parameter.name in FLOW.artefacts:
            reader = FLOW.artefacts[parameter.name].reader
            returned = returned_by(resolve_reference(reader)) if reader else "bytes"
            expected = f"Mapping[str, {returned}]" if definition.for_several else returned
            assert annotation.removesuffix(" | None") == expected
        else:
            assert parameter.name in {"key", "report", "maps", "map_service", "services"}


def test_inputs_are_made_by_earlier_stages():
    for definition in FLOW.stages:
        for artefact in FLOW.inputs(definition).values():
            assert artefact.stage.position < definition.stage.position
    assert not FLOW.inputs(FLOW.definition(Stage.RAW_REPORT))

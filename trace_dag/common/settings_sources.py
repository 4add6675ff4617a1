"""Reading the settings: from ``<root>/settings.toml`` and from the environment (``TRACE_DAG_SIM__STEP_S=0.002``).

The environment wins. A value that does not fit is reported with the name of the setting, the value found and what
was expected."""

from __future__ import annotations

import difflib
import json
import os
import tomllib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from pydantic import ValidationError

from trace_dag.common.errors import UserError, UserErrors
from trace_dag.common.settings import Settings

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

_PREFIX = "TRACE_DAG_"
_SHOWN = 80  # characters of a value that is wrong


def load_settings(
    toml: bytes = b"", *, name: str = "settings.toml", overrides: Mapping[str, Any] | None = None
) -> Settings:
    """Return settings from a TOML file's content, the environment and ``overrides``; later ones win.

    ``overrides`` has the shape of the file: ``{"states": {"estimator": "llm"}}``. Raises :class:`UserError` that names
    the setting, the value found and what was expected.
    """
    from_environment = _from_environment()
    try:
        merged = _merge(_merge(_from_file(toml, name), from_environment), overrides or {})
        return Settings.model_validate(merged)
    except ValidationError as error:
        wrong = []
        for each in error.errors():
            source = name
            if _holds(overrides or {}, each["loc"]):
                source = "the command line"
            elif _holds(from_environment, each["loc"]):
                source = "environment variable " + _PREFIX + "__".join(map(str, each["loc"][:2])).upper()
            setting = ".".join(map(str, each["loc"]))
            wrong.append(f"setting {setting} = {_shortened(each['input'])} (from {source}): {_expected(each)}")
        raise UserErrors(wrong) from error


def _holds(settings: Mapping[str, Any], path: tuple[int | str, ...]) -> bool:
    """Return whether a source of settings sets the one at a path (section, name)."""
    section = settings.get(str(path[0]), {}) if path else {}
    return len(path) > 1 and isinstance(section, Mapping) and path[1] in section


def _expected(error: ErrorDetails) -> str:
    """Return the expected form of a value, in words without Python's types."""
    if error["type"] == "tuple_type":
        return 'expected a list, such as ["a", "b"] or [1, 2]'
    if error["type"] != "extra_forbidden":
        return error["msg"]
    *before, last = map(str, error["loc"])
    if len(before) > 1:  # of an item of a list
        return "there is no such setting; trace-dag settings lists them"
    known = _fields(Settings.model_fields[before[0]].annotation) if before else list(Settings.model_fields)
    near = difflib.get_close_matches(last, known, n=1)
    meant = f"did you mean {'.'.join((*before, near[0]))}? " if near else ""
    return f"there is no such {'setting' if before else 'section'}; {meant}trace-dag settings lists them"


def _fields(section: Any) -> list[str]:
    return list(getattr(section, "model_fields", {}))


class DescribedSetting(NamedTuple):
    """A setting with its value and the value's source: ``default``, the file's name, or ``environment``."""

    section: str
    name: str
    value: Any
    default: Any
    source: str
    meaning: str


def described_settings(toml: bytes = b"", *, name: str = "settings.toml") -> list[DescribedSetting]:
    """Return every setting as :func:`load_settings` finds it, in the order of the sections."""
    settings = load_settings(toml, name=name)
    from_file, from_environment = _from_file(toml, name), _from_environment()
    described = []
    for section in Settings.model_fields:
        values = getattr(settings, section)
        for setting, field in type(values).model_fields.items():
            source = "default"
            if setting in from_file.get(section, {}):
                source = name.rpartition("/")[2]
            if setting in from_environment.get(section, {}):
                source = "environment"
            default = field.get_default(call_default_factory=True)
            value = getattr(values, setting)
            described.append(DescribedSetting(section, setting, value, default, source, field.description or ""))
    return described


def _from_file(toml: bytes, name: str) -> dict[str, Any]:
    try:
        return tomllib.loads(toml.decode())
    except (ValueError, RecursionError) as error:  # a number of thousands of digits is a plain ValueError
        raise UserError(f"{name}: not TOML ({error}); mend it or delete it to use the defaults") from error


def _from_environment() -> dict[str, Any]:
    """Return the settings that are in the environment; lists, tables and whole sections are JSON there.

    Raises UserErrors for broken JSON, and for variables that look like misspelt settings, which would otherwise go
    unnoticed.
    """
    found: dict[str, Any] = {}
    wrong = []
    for variable, text in sorted(os.environ.items()):
        if not variable.upper().startswith(_PREFIX):
            continue
        section, separator, name = variable.lower().removeprefix(_PREFIX.lower()).partition("__")
        if section not in Settings.model_fields:
            wrong += _misnamed(variable, section, name)
            continue
        try:
            value = json.loads(text) if text.startswith(("[", "{")) else None if text == "null" else text
        except (ValueError, RecursionError) as error:
            wrong.append(f"environment variable {variable} = {_shortened(text)}: expected JSON ({error})")
        else:
            found = _merge(found, {section: {name: value} if separator else value})
    if wrong:
        raise UserErrors(wrong)
    return found


def _misnamed(variable: str, section: str, name: str) -> list[str]:
    """Return what may be meant by a variable that names no section, if it looks like a setting."""
    if name:
        near = difflib.get_close_matches(section, Settings.model_fields, n=1)
        meant = f"did you mean {_PREFIX}{near[0].upper()}__{name.upper()}" if near else ""
        expected = meant or "sections are " + ", ".join(Settings.model_fields)
        return [f"environment variable {variable}: there is no section {section}; {expected}"]
    before, _, after = section.partition("_")
    if before in Settings.model_fields:
        expected = f"{_PREFIX}{before.upper()}__{after.upper()}, with two underscores"
        return [f"environment variable {variable}: expected {expected}"]
    return []


def _shortened(value: object) -> str:
    text = repr(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


def _merge(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for name, value in over.items():
        below = merged.get(name)
        merged[name] = _merge(below, value) if isinstance(below, Mapping) and isinstance(value, Mapping) else value
    return merged

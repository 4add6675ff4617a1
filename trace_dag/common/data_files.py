"""Tables that are part of the package, as CSV and TOML files beside the modules that read them."""

from __future__ import annotations

import csv
import tomllib
from importlib import resources
from typing import Any


def read_csv(package: str, name: str) -> list[dict[str, str]]:
    """Return the rows of a CSV file of a package, as texts by column.

    >>> read_csv("trace_dag.crash", "crash_types.csv")[20]["configuration"]
    'D, rear end'
    """
    text = resources.files(package).joinpath(name).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))


def read_toml(package: str, name: str) -> dict[str, Any]:
    """Return the content of a TOML file of a package.

    >>> read_toml("trace_dag.roads.crash_site", "street_words.toml")["types"]["LANE"]
    ['LN', 'LA']
    """
    return tomllib.loads(resources.files(package).joinpath(name).read_text(encoding="utf-8"))

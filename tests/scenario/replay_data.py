"""What a replay's page holds, as its script reads it."""

from __future__ import annotations

import json
import re
from itertools import accumulate
from typing import Any


def data_of(page: bytes) -> dict[str, Any]:
    """The data of a page that stands alone."""
    (found,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', page.decode(), re.DOTALL)
    data: dict[str, Any] = json.loads(found, object_hook=_column)
    return data


def _column(kept: dict[str, Any]) -> Any:
    """A long column again, from its second differences."""
    if "by" not in kept:
        return kept
    by, rows = kept["by"], len(kept["by"]) // kept.get("width", 1)
    columns = [
        [whole / kept["per"] for whole in accumulate(accumulate(by[start : start + rows]))]
        for start in range(0, len(by), rows)
    ]
    return [list(row) for row in zip(*columns, strict=True)] if "width" in kept else columns[0]

"""What a replay's page holds, as its script reads it."""

from __future__ import annotations

import json
import re
from typing import Any


def data_of(page: bytes) -> dict[str, Any]:
    """The data of a page that stands alone."""
    (found,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', page.decode(), re.DOTALL)
    data: dict[str, Any] = json.loads(found)
    return data

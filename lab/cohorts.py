"""Cohorts of any size: the reports of the bundled sample, repeated under new case numbers."""

from __future__ import annotations

import re
from itertools import cycle
from pathlib import Path

SAMPLE = Path(__file__).resolve().parents[1] / "data" / "sample"
MAPS = SAMPLE / "osm"
_FIRST_CASE = 310_001  # of the sample's fictional state; case numbers have six digits


def repeated_sample(folder: Path, crashes: int) -> Path:
    """Return a folder with that many reports.

    Up to 9,999 in one case year, the rest in the years before.
    """
    folder.mkdir(parents=True, exist_ok=True)
    reports = sorted((SAMPLE / "reports").glob("crash_*.xml"))
    for number, report in zip(range(crashes), cycle(reports), strict=False):
        year, case = 2023 - number // 9_999, str(_FIRST_CASE + number % 9_999)
        text = report.read_text().replace(report.stem.partition("_")[2], case)
        if year != 2023:
            text = re.sub(r"(<(?:CaseYear|CASEYEAR|YEAR)>|CaseYear: )2023", rf"\g<1>{year}", text)
        (folder / f"crash_{year}_{case}.xml").write_text(text)
    return folder

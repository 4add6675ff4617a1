"""Names of streets, makes and maps that are code in the formats they end up in: a crash run, packed and shown."""

from __future__ import annotations

import json
import re
from html import escape
from pathlib import Path

import pytest
from markdown_it import MarkdownIt
from sample_runs import SAMPLE, trace_dag

KEY = "2023-319003"
NAME = "<script>alert(1)</script>[x](javascript:alert(2)) ${alert(3)} `c` | &lt;b&gt;"
FORMULA = r"$\frac{$"
"""What a plotting library would read as a formula, and not a right one; short enough to be drawn on its street."""


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("names")
    report = (SAMPLE / "reports" / "crash_319003.xml").read_text()
    for tag, before in (("MAK_MODNAME", ""), ("TWAY_ID2", "ELDER ST ")):
        report = report.replace(f"<{tag}>", f"<{tag}>{before}{escape(NAME)}")
    (folder / "crash_319003.xml").write_text(report)
    town = (SAMPLE / "osm" / "merrow.osm").read_text()
    town = town.replace('copyright="fictional, CC0"', f'attribution="fictional, CC0 {escape(NAME)}"')
    town = town.replace('v="Elder Street"', f'v="Elder Street {escape(FORMULA)}"')
    (folder / "town.osm").write_text(town)
    root = folder / "root"
    maps = str(folder / "town.osm")
    done = trace_dag(root, "ingest", "--reports", str(folder / "crash_319003.xml"), "--maps", maps, "--cohort", "names")
    assert done.returncode == 0, done.stderr
    done = trace_dag(root, "run")
    assert done.returncode == 0, done.stderr
    return root


@pytest.fixture(scope="module")
def package(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("package")
    done = trace_dag(root, "export", "--only", KEY, "--output", str(folder))
    assert done.returncode == 0, done.stderr
    return folder / KEY


def test_it_is_verified_drawn_and_shown(root: Path):
    assert json.loads(trace_dag(root, "status", "--json").stdout)["final_states"]["verified"] == 1
    assert (root / "pictures" / f"{KEY}.png").is_file()


@pytest.mark.parametrize("name", ["README.md", "LICENSES.md"])
def test_markdown_of_packages_shows_names_as_written(package: Path, name: str):
    rendered = MarkdownIt("commonmark", {"html": True}).enable("table").render((package / name).read_text())
    assert escape(NAME, quote=False) in rendered
    assert "<script" not in rendered
    assert 'href="javascript' not in rendered


def test_documents_of_releases_do_too(root: Path, tmp_path: Path):
    done = trace_dag(root, "release", "--version", "1.0", "--output", str(tmp_path))
    assert done.returncode == 0, done.stderr
    for name in ("README.md", "DATASHEET.md", "LICENSES.md"):
        (path,) = tmp_path.rglob(name)
        rendered = MarkdownIt("commonmark", {"html": True}).enable("table").render(path.read_text())
        assert "<script" not in rendered
        assert "javascript:" not in re.sub(r">[^<]*<", "><", rendered)


def test_a_replay_runs_no_script_but_its_own(package: Path):
    page = (package / "replay.html").read_text()
    (data,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', page, re.DOTALL)
    assert NAME in json.loads(data)["attribution"]
    shown = json.loads(data)["vehicles"][0]["make"].lower()  # without FARS' notes in parentheses
    assert "<script>alert" in shown
    assert "`c` | &lt;b&gt;" in shown
    assert "alert(" not in page.replace(data, "").replace(escape(NAME), "")


def test_pages_of_the_site_hold_names_as_text(root: Path):
    pages = list((root / "benchmark").rglob("*.html"))
    assert pages
    for page in pages:
        assert "<script>alert" not in page.read_text(), page


def test_a_replay_of_the_site_loads_data_alone(root: Path):
    """One call with base64, which has no meaning for JavaScript, whatever the report holds."""
    script = (root / f"benchmark/replays/{KEY}.js").read_text(encoding="ascii")
    assert re.fullmatch(r'replay\(\{("\w+":"[A-Za-z0-9+/=]+",?)+\}\)\n', script)

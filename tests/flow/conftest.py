"""A storage root with a cohort of fake crashes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import fake_flow
import pytest

from trace_dag.flow.workspace import Workspace

MakeWorkspace = Callable[..., Workspace]


@pytest.fixture
def make_workspace(tmp_path: Path) -> MakeWorkspace:
    """Registers crashes by key and behaviour, and opens the pipeline on them."""

    def make(behaviours: Mapping[str, str] | None = None, **sections: Any) -> Workspace:
        overrides = {"execution": {"executor": "in_process", "retry_wait_s": 0.0}}
        for name, section in sections.items():
            overrides.setdefault(name, {}).update(section)
        workspace = Workspace.open(str(tmp_path / "root"), fake_flow.FLOW, overrides)
        if behaviours is not None:
            workspace.registry.register("fakes", fake_flow.write_reports(tmp_path / "reports", behaviours))
        return workspace

    return make

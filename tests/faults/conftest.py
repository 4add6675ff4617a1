"""The storage root with fake crashes that the flow's tests use."""

from flow.conftest import make_workspace

__all__ = ["make_workspace"]

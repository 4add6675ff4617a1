"""The storage root with fake crashes that the pipeline's tests use."""

from pipeline.conftest import make_pipeline

__all__ = ["make_pipeline"]

"""The storage root as a Dagster resource."""

from dagster import ConfigurableResource, InitResourceContext
from pydantic import Field

from trace_dag.pipeline.home import Home, storage_root
from trace_dag.pipeline.stages import FLOW


class HomeResource(ConfigurableResource[Home]):
    """Builds the :class:`Home` that assets, checks and sensors work on."""

    root: str = Field(default="", description="Storage root; empty: TRACE_DAG_ROOT, else ./trace_dag_home.")

    def create_resource(self, context: InitResourceContext) -> Home:
        """The home at that root, with the real stages."""
        return Home(storage_root(self.root), FLOW)

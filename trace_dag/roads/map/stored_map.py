"""A road map's file, parsed once for the check of rules and for the network."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from trace_dag.roads.map.reader import network_of, parse_opendrive
from trace_dag.roads.map.rules import violations_of

if TYPE_CHECKING:
    from lxml import etree

    from trace_dag.roads.map.network import RoadNetwork


class StoredMap:
    """An OpenDRIVE file, ``xodr``, parsed when first needed; ``name`` is for messages.

    A file that is not OpenDRIVE raises :class:`~trace_dag.common.errors.UserError` then.
    """

    def __init__(self, xodr: bytes, *, name: str = "map") -> None:
        self.xodr = xodr
        self.name = name

    @cached_property
    def _root(self) -> etree._Element:
        return parse_opendrive(self.xodr, self.name)

    @cached_property
    def violations(self) -> list[str]:
        """Return every broken rule with its place (:func:`~trace_dag.roads.map.rules.find_violations`)."""
        return violations_of(self._root)

    @cached_property
    def network(self) -> RoadNetwork:
        """Return the network read back from the file."""
        return network_of(self._root, name=self.name)

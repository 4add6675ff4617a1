"""The colours that pictures, replays and sketches of a crash share."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from trace_dag.crash.parties import party_of_body

VEHICLE_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#F0E442", "#56B4E9")
"""Okabe and Ito's palette: told apart with every common kind of colour vision. Vehicle 1 is blue, 2 vermilion."""
REPORTED_COLOUR: Final = "#000000"
CONTACT_COLOUR: Final = "#B00020"
OBJECT_COLOUR: Final = "#6B4A2B"
"""Colour of fixed objects: brown, with a broken outline where the program placed them."""


def vehicle_colour(index: int) -> str:
    """Return the colour of the vehicle that is the ``index``-th by number, from 0.

    >>> vehicle_colour(0), vehicle_colour(6)  # six of them, then from the start
    ('#0072B2', '#0072B2')
    """
    return VEHICLE_COLOURS[index % len(VEHICLE_COLOURS)]


def body_colour(number: int, numbers: Iterable[int]) -> str:
    """Return the colour of a body among those of a simulation; a trailer has that of its vehicle."""
    return vehicle_colour(list(numbers).index(party_of_body(number)))

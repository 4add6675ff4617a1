"""Elements of OpenSCENARIO that several parts of a scenario are made of, written with lxml.

Their names and attributes are the standard's (ASAM OpenSCENARIO XML 1.0.0 and 1.2.0), in the order of its schema.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from lxml import etree

from trace_dag.simulation.types import Body

Element: TypeAlias = etree._Element


def element(tag: str, /, *children: Element | None, **attributes: object) -> Element:
    """Return an element with its children and attributes in this order, without those that are None.

    >>> etree.tostring(element("Sun", azimuth=1.5, intensity=None))
    b'<Sun azimuth="1.5"/>'
    """
    said = {name: _text(value) for name, value in attributes.items() if value is not None}
    made = etree.Element(tag, said)
    made.extend([child for child in children if child is not None])
    return made


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def bounding_box(width_m: float, length_m: float, height_m: float, *, ahead_m: float, up_m: float) -> Element:
    """Return a box whose middle is ``ahead_m`` ahead of and ``up_m`` above the reference point.

    >>> bounding_box(1.8, 4.5, 1.5, ahead_m=1.4, up_m=0.75)[0].get("x")
    '1.4'
    """
    return element(
        "BoundingBox",
        element("Center", x=round_m(ahead_m), y=0.0, z=round_m(up_m)),
        element("Dimensions", width=round_m(width_m), length=round_m(length_m), height=round_m(height_m)),
    )


def box_of(body: Body, reference_ahead_m: float) -> Element:
    """Return the box of a body on the road with its reference point ahead of its middle.

    >>> float(box_of(log.bodies[1], -1.4)[0].get("x"))
    1.4
    """
    return bounding_box(body.width_m, body.length_m, body.height_m, ahead_m=-reference_ahead_m, up_m=body.height_m / 2)


def properties(values: Mapping[str, str]) -> Element:
    """Return the properties of an entity beyond the standard, by name.

    >>> properties({"placed_by": "program"})[0].get("value")
    'program'
    """
    return element("Properties", *(element("Property", name=name, value=value) for name, value in values.items()))


def teleport_action(*pose: float) -> Element:
    """Return the action that places an entity.

    It has x, y, z (m), heading, and optionally pitch and roll (rad).

    >>> etree.tostring(teleport_action(1.0, 2.0, 0.0, 0.5)).count(b"WorldPosition")
    1
    """
    position = element("Position", element("WorldPosition", **dict(zip("xyzhpr", pose, strict=False))))
    return element("PrivateAction", element("TeleportAction", position))


def round_m(value_m: float) -> float:
    """Round to a tenth of a millimetre, without a negative zero.

    >>> round_m(1.23456), round_m(-0.00001)
    (1.2346, 0.0)
    """
    return round(value_m, 4) + 0.0

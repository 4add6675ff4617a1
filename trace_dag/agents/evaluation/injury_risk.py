"""The risk of serious injury in a contact, by the curves of the warehouse's view ``injury_risk``.

The curves are for occupants of cars and people on foot, and here cover all directions. For motorcyclists, whose risk is
higher, and for trucks they only rank contacts of the same bodies.
"""

from __future__ import annotations

import math

from trace_dag.common.units import mps_to_mph
from trace_dag.simulation.types import Body, Contact

_TEFFT_10_MPH, _TEFFT_90_MPH = 17.1, 48.1


def occupants_risk(delta_v_mps: float) -> float:
    """Return the risk of serious injury (MAIS 3 and more) of a car's occupants.

    Malliaris, Digges, DeBlois, SAE 970393, 1997.

    >>> round(occupants_risk(10.0), 3), round(occupants_risk(20.0), 3)
    (0.187, 0.925)
    """
    return _logistic(-5.450 + 0.178 * mps_to_mph(delta_v_mps))


def struck_persons_risk(closing_mps: float) -> float:
    """Return the risk of severe injury (AIS 4 and more) of a person struck.

    Tefft, Accident Analysis and Prevention 50, 2013.

    >>> round(struck_persons_risk(17.1 * 0.44704), 2), round(struck_persons_risk(48.1 * 0.44704), 2)
    (0.1, 0.9)
    """
    middle, slope = (_TEFFT_10_MPH + _TEFFT_90_MPH) / 2, 2 * math.log(9) / (_TEFFT_90_MPH - _TEFFT_10_MPH)
    return _logistic(slope * (mps_to_mph(closing_mps) - middle))


def risk_of_contact(contact: Contact | None, bodies: dict[int, Body]) -> float:
    """Return the larger risk of the two bodies in contact; 0 without a contact."""
    if contact is None:
        return 0.0
    risks = []
    for number, delta_v_mps in ((contact.number_1, contact.delta_v_1_mps), (contact.number_2, contact.delta_v_2_mps)):
        if number in bodies and bodies[number].is_figure:
            risks.append(struck_persons_risk(contact.closing_speed_mps))
        elif number in bodies:
            risks.append(occupants_risk(math.hypot(*delta_v_mps)))
    return max(risks)


def _logistic(log_odds: float) -> float:
    return 1 / (1 + math.exp(-log_odds))

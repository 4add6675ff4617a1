"""Names of states as people write them."""

from __future__ import annotations

from typing import Final

from trace_dag.common.errors import UserError
from trace_dag.crash.codes.crash import STATES

_ABBREVIATIONS: Final = (
    "AL AK AZ AR CA CO CT DE DC FL GA HI ID IL IN IA KS KY LA ME MD MA MI MN MS MO MT NE NV NH NJ NM NY NC ND OH OK OR "
    "PA PR RI SC SD TN TX UT VT VA VI WA WV WI WY"  # in the order of the codes
)
_POSTAL: Final = dict(
    zip(
        STATES,
        _ABBREVIATIONS.split(),
        strict=True,
    )
)
_BY_NAME: Final = {name.casefold(): code for names in (STATES, _POSTAL) for code, name in names.items()}


def state_code(text: str) -> int:
    """Return the ``STATE`` code of a state given as code, postal abbreviation or name.

    Raises UserError for other text.

    >>> state_code('VA'), state_code('virginia'), state_code('51')
    (51, 51, 51)
    """
    if text.isascii() and text.isdigit() and int(text) in STATES:
        return int(text)
    code = _BY_NAME.get(" ".join(text.split()).casefold())
    if code is None:
        raise UserError(
            f"{text!r} is not a state; expected a postal abbreviation, a name or a FARS code: VA, Virginia, 51"
        )
    return code


def state_abbreviation(code: int) -> str:
    """Return the postal abbreviation of a ``STATE`` code, or the code if it is no state's.

    >>> state_abbreviation(51)
    'VA'
    """
    return _POSTAL.get(code, str(code))

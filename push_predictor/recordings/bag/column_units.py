# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Names of columns with a unit, such as `x [mm]`: what they measure, and the factor to the SI unit."""

from __future__ import annotations

import math
import re
from decimal import Decimal
from typing import NamedTuple

_NUMBER = {"1": "1", "-": "1"}
_LENGTH = {"m": "1", "cm": "1e-2", "mm": "1e-3", "um": "1e-6", "µm": "1e-6"}
_TIME = {"s": "1", "sec": "1", "seconds": "1", "ms": "1e-3", "us": "1e-6", "µs": "1e-6", "ns": "1e-9"}
_ANGLE = {"rad": "1", "deg": str(math.pi / 180.0), "°": str(math.pi / 180.0), "mrad": "1e-3"}
_FORCE = {"n": "1", "mn": "1e-3", "kn": "1e3"}
_TORQUE = {"nm": "1", "n m": "1", "n*m": "1", "n·m": "1", "nmm": "1e-3", "n mm": "1e-3", "ncm": "1e-2", "mnm": "1e-3"}
UNITS = {
    "time": _TIME,
    **dict.fromkeys("xyz", _LENGTH),
    "heading": _ANGLE,
    **dict.fromkeys(("fx", "fy", "fz"), _FORCE),
    **dict.fromkeys(("tx", "ty", "tz", "torque"), _TORQUE),
    **dict.fromkeys(("qx", "qy", "qz", "qw"), _NUMBER),
}
_NAMED = re.compile(r"(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]")


class Column(NamedTuple):
    """name: in lower case, without the unit; unit: as written, '' without one; factor: to the SI unit."""

    name: str
    unit: str = ""
    factor: Decimal = Decimal(1)


def column_of(text: str) -> Column:
    """The column that a cell of the header names. Raises ValueError, which states the units, for an unknown one."""
    found = _NAMED.fullmatch(text.strip())
    name = (found[1] if found else text.strip()).lower()
    if found is None or name not in UNITS:
        return Column(text.strip().lower())
    if (factor := UNITS[name].get(found[2].lower())) is None:
        raise ValueError(f"column {text!r} has an unknown unit, give {', '.join(UNITS[name])}")
    return Column(name, found[2], Decimal(factor))

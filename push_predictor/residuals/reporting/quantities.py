# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Numbers for readers: with unit, 95 % interval and a minus sign."""

from __future__ import annotations

import numpy as np

from push_predictor.reporting.html import NOTHING, number
from push_predictor.residuals.outcome import Gain, Sized

SHOWN_UNITS = {"m": (1e3, "mm"), "rad": (float(np.degrees(1.0)), "deg"), "s": (1e3, "ms"), "1": (1.0, "")}


def shown_unit(unit: str) -> tuple[float, str]:
    """The factor to, and the name of, the unit in which a size is shown."""
    return SHOWN_UNITS.get(unit, (1.0, unit))


def in_shown_unit(size: Sized) -> tuple[Gain, str]:
    """A size with its interval in the unit in which it is shown."""
    factor, unit = shown_unit(size.unit)
    return Gain(factor * size.value, factor * size.low, factor * size.high), unit


def estimate(value: Gain, unit: str = "", p_value: float | None = None) -> str:
    """A number with its 95 % interval and p value: 0.76 (95 % CI 0.73 to 0.80, p = 0.001)."""
    known = bool(np.isfinite([value.low, value.high]).all())
    parts = [f"95 % CI {_shown(value.low, value)} to {_shown(value.high, value)}"] if known else []
    parts += [] if p_value is None else [f"p = {p_text(p_value)}"]
    text = f"{_shown(value.value, value)} {unit}".strip()
    return f"{text} ({', '.join(parts)})" if parts else text


def interval_cell(value: Gain, unit: str = "") -> str:
    """A number with its unit over its 95 % interval, for the cell of a table."""
    text = f"{_shown(value.value, value)} {unit}".strip()
    known = bool(np.isfinite([value.low, value.high]).all())
    return f"{text}\n[{_shown(value.low, value)}, {_shown(value.high, value)}]" if known else text


def p_text(p_value: float) -> str:
    """A p value with two significant digits."""
    return number(p_value, 2)


def count(n: int, one: str, many: str) -> str:
    """A number of things."""
    return f"{n} {one if n == 1 else many}"


def _shown(value: float, interval: Gain) -> str:
    """A number with as many decimals as its interval determines."""
    if not np.isfinite(value):
        return NOTHING
    width = interval.high - interval.low
    if not np.isfinite(width) or width <= 0.0:
        return number(value, 3)
    power = int(np.floor(np.log10(width)))
    decimals = -power + (width / 10.0**power <= 3.0)  # one digit of the width, two if it begins with 1 to 3
    shown = round(value, max(0, decimals)) + 0.0  # no minus zero
    return f"{shown:.{max(0, decimals)}f}".replace("-", "−")

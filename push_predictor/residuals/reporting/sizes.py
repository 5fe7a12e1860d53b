# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The size of an effect as numbers and in one clause: the shift of a window first, then the parameter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.pushes import Push
from push_predictor.reporting.html import number
from push_predictor.residuals.evidence.standardised import mechanics_under
from push_predictor.residuals.outcome import FoundEffect, Trace
from push_predictor.residuals.reporting import phrases as say

USUAL = "contact_friction"  # the mechanism whose detectable size is shown if nothing was found
NO_ENDS = ("periodic", "periodic, twice around", "category", "map")  # bases whose size is their largest difference


def shift_size(trace: Trace, effect: Effect) -> tuple[float, float]:
    """Root mean square shift of the position (m) and of the heading (rad) over the windows of the analysis."""
    square = np.mean(joint_shift(mechanics_under(trace.model), [effect], Push.of(trace.analysis)) ** 2, axis=0)
    return float(np.hypot(*np.sqrt(square[:2]))), float(np.sqrt(square[2]))


def effect_size(trace: Trace, index: int, p_value: float | None = None) -> str:
    """How far an effect shifts a window, root mean square, then its parameter; to follow "it"."""
    effect = trace.effects[index]
    metres, radians = shift_size(trace, trace.terms[index])
    shift = f"shifts a window by {1e3 * metres:.2g} mm and {np.degrees(radians):.2g} deg"
    return shift if effect.parameter is None else f"{shift}: {parameter(effect, p_value)}"


def parameter(effect: FoundEffect, p_value: float | None = None) -> str:
    """The parameter of an effect with its interval; of a change, whether the quantity is lower or higher."""
    assert effect.parameter is not None  # the caller has checked it
    value, unit = say.in_shown_unit(effect.parameter)
    name = effect.parameter.name.partition(", ")[0]
    changed = name.removeprefix("change of the ")
    if changed == name:
        return f"{name} is {say.interval(value, unit, p_value)}"
    if effect.basis in NO_ENDS:
        return f"{changed} differs by up to {say.interval(value, unit, p_value)}"
    return f"{changed} {say.interval(value.size(), unit, p_value, 'lower' if value.value < 0.0 else 'higher')}"


def detectable(trace: Trace) -> str:
    """The smallest effect that would have been found."""
    name = USUAL if USUAL in trace.minimum_detectable else next(iter(trace.minimum_detectable), USUAL)
    size = detectable_size(trace.minimum_detectable.get(name, {}), 2)
    if not size:
        tried = say.count(len(trace.tested), "candidate", "candidates")
        return f"not one of {tried} explains the errors of these pushes"
    return f"a change of {say.mechanism_phrase(name)} by {size} would have been found with 80 % probability"


def detectable_size(entry: Mapping[str, Any], digits: int) -> str:
    """The value of an entry of minimum_detectable with its unit; empty if it is unknown."""
    value, (factor, unit) = entry.get("value"), say.shown_unit(str(entry.get("unit", "")))
    return "" if value is None or not np.isfinite(value) else f"{number(factor * float(value), digits)} {unit}".strip()

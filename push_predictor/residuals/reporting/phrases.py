# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Words for mechanisms, covariates, numbers and sizes: identifiers belong in tables and JSON, not in prose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.models.effects.covariates import COVARIATES, UNITS
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.mechanisms import LIBRARY, REFINEMENTS
from push_predictor.models.pushes import Push
from push_predictor.reporting.html import NOTHING, count, number
from push_predictor.residuals.evidence.drivers import CONSTANT, SESSION, UNDRIVEN
from push_predictor.residuals.evidence.standardised import mechanics_under
from push_predictor.residuals.outcome import FoundEffect, Sized, Trace

MECHANISMS = {mechanism.name: mechanism for mechanism in (*LIBRARY, *REFINEMENTS)}

# Of findings that are no mechanism of the motion.
OTHERS = {
    "surface_friction": "the force needed to push the slider",
    "wrench_bias": "a bias of the force sensor",
    "clock_offset": "a clock offset between tracker and robot",
    "frame_rotation": "a rotation of the tracker's frame",
    "frame_shift": "a shift of the tracker's frame",
    "tool_offset": "an offset of the tool point",
}

USUAL = "contact_friction"  # the mechanism whose detectable size is shown if nothing was found
NO_ENDS = ("periodic", "periodic, twice around", "category", "map")  # bases whose size is their largest difference
NAMED = {SESSION: "the session (since training)", CONSTANT: "nothing (constant)"}  # what is no covariate
SHOWN_UNITS = {"m": (1e3, "mm"), "rad": (float(np.degrees(1.0)), "deg"), "s": (1e3, "ms"), "1": (1.0, "")}


def mechanism_phrase(mechanism: str | None) -> str:
    """A mechanism as a noun phrase; "an unknown mechanism" for None."""
    if mechanism is None:
        return "an unknown mechanism"
    return MECHANISMS[mechanism].noun if mechanism in MECHANISMS else OTHERS.get(mechanism, mechanism.replace("_", " "))


def covariate_phrase(covariate: str) -> str:
    """A covariate in words; a recorded topic by its name."""
    if covariate.startswith("topic:"):
        return f"topic {covariate.removeprefix('topic:')}"
    known = COVARIATES.get(covariate)
    return known.phrase if known else NAMED.get(covariate, covariate.replace("_", " "))


def effect_phrase(mechanism: str | None, covariate: str) -> str:
    """An effect as a noun phrase: mechanism and covariate."""
    if covariate in UNDRIVEN:
        return f"{mechanism_phrase(mechanism)} (constant)"
    return f"{mechanism_phrase(mechanism)} (depends on {covariate_phrase(covariate)})"


def step_phrase(covariate: str, place: float) -> str:
    """Where or when a step sets in, to follow a verb."""
    if covariate == "elapsed_time":
        return f"{place:.0f} s into the session"
    if covariate == "push_index":
        return f"after push {np.floor(place):.0f}"
    if covariate == "slid_distance":
        return f"after {number(place, 3)} m of sliding"
    factor, unit = shown_unit_of(covariate)
    return f"where {covariate_phrase(covariate)} exceeds {number(factor * place, 3)} {unit}".rstrip()


def listed(phrases: Sequence[str]) -> str:
    """Phrases as a list in a sentence."""
    *first, last = phrases
    return f"{', '.join(first)} and {last}" if first else last


def bare(phrase: str) -> str:
    """A phrase without its article, for the cell of a table."""
    return phrase.removeprefix("the ").removeprefix("an ").removeprefix("a ")


def capitalised(text: str) -> str:
    """A text with its first letter in upper case."""
    return text[:1].upper() + text[1:]


def shown_unit_of(covariate: str) -> tuple[float, str]:
    """The factor to, and the name of, the unit in which pictures and sentences show a covariate."""
    known = COVARIATES.get(covariate)
    return known.shown if known and known.shown else (1.0, UNITS.get(covariate, ""))


# --- numbers with unit, 95 % interval and a minus sign ----------------------------------------------------------------


def shown_unit(unit: str) -> tuple[float, str]:
    """The factor to, and the name of, the unit in which a size is shown."""
    return SHOWN_UNITS.get(unit, (1.0, unit))


def in_shown_unit(size: Sized) -> tuple[Estimate, str]:
    """A size with its interval in the unit in which it is shown."""
    factor, unit = shown_unit(size.unit)
    return size.estimate.times(factor), unit


def interval(value: Estimate, unit: str = "", p_value: float | None = None, word: str = "") -> str:
    """A number with its 95 % interval and p value: 0.76 (95 % CI 0.73 to 0.80, p = 0.001); word: after the unit."""
    known = bool(np.isfinite([value.low, value.high]).all())
    parts = [f"95 % CI {_shown(value.low, value)} to {_shown(value.high, value)}"] if known else []
    parts += [] if p_value is None else [f"p = {p_text(p_value)}"]
    text = " ".join(filter(None, [_shown(value.value, value), unit, word]))
    return f"{text} ({', '.join(parts)})" if parts else text


def p_text(p_value: float) -> str:
    """A p value with two significant digits."""
    return number(p_value, 2)


def _shown(value: float, ends: Estimate) -> str:
    """A number with as many decimals as its interval determines."""
    if not np.isfinite(value):
        return NOTHING
    width = ends.high - ends.low
    if not np.isfinite(width) or width <= 0.0:
        return number(value, 3)
    power = int(np.floor(np.log10(width)))
    decimals = -power + (width / 10.0**power <= 3.0)  # one digit of the width, two if it begins with 1 to 3
    shown = round(value, max(0, decimals)) + 0.0  # no minus zero
    return f"{shown:.{max(0, decimals)}f}".replace("-", "−")


# --- the size of an effect: the shift of a window first, then the parameter -------------------------------------------


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
    value, unit = in_shown_unit(effect.parameter)
    name = effect.parameter.name.partition(", ")[0]
    changed = name.removeprefix("change of the ")
    if changed == name:
        return f"{name} is {interval(value, unit, p_value)}"
    if effect.basis in NO_ENDS:
        return f"{changed} differs by up to {interval(value, unit, p_value)}"
    return f"{changed} {interval(value.size(), unit, p_value, 'lower' if value.value < 0.0 else 'higher')}"


def detectable(trace: Trace) -> str:
    """The smallest effect that would have been found."""
    name = USUAL if USUAL in trace.minimum_detectable else next(iter(trace.minimum_detectable), USUAL)
    size = detectable_size(trace.minimum_detectable.get(name, {}), 2)
    if not size:
        tried = count(len(trace.tested), "candidate", "candidates")
        return f"not one of {tried} explains the errors of these pushes"
    return f"a change of {mechanism_phrase(name)} by {size} would have been found with 80 % probability"


def detectable_size(entry: Mapping[str, Any], digits: int) -> str:
    """The value of an entry of minimum_detectable with its unit; empty if it is unknown."""
    value, (factor, unit) = entry.get("value"), shown_unit(str(entry.get("unit", "")))
    return "" if value is None or not np.isfinite(value) else f"{number(factor * float(value), digits)} {unit}".strip()

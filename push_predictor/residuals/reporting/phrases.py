# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Words for mechanisms, covariates and numbers: identifiers belong in tables and JSON, not in prose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.models.effects.covariates import COVARIATES, UNITS
from push_predictor.models.mechanisms import LIBRARY, REFINEMENTS
from push_predictor.reporting.html import NOTHING, number
from push_predictor.residuals.evidence.drivers import CONSTANT, SESSION, UNDRIVEN
from push_predictor.residuals.outcome import Sized

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


def count(n: int, one: str, many: str) -> str:
    """A number of things."""
    return f"{n} {one if n == 1 else many}"


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

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Whether the 95 % interval of a reported parameter covers the true value.

Compared are effects whose reported mechanism is the true one, where truth and trace state a size of the same meaning:

- contact_friction; tilted_surface, if the truth states the table's friction; centre_of_friction of the foreign rig;
  anisotropic_friction and body_anisotropy of the project's simulator; surface_friction; clock_offset; frame_rotation
- constant since training, and reported as constant or since training
- a step, and reported as a step along the true covariate or along another measure of progress
- linear along a measure of progress, and reported as linear along one of them

Not compared: pressure_spread (its truth is a parameter of the load, not the spread), centre_of_friction of the
project's simulator (its truth is the shift to first order) and the anisotropies of the foreign rig (another law of
friction). Nor are vectors of which the trace reports each component (frame_shift, tool_offset, wrench_bias), as the
truth has only their length.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from math import expm1
from typing import Any

PROGRESS = ("push_index", "elapsed_time", "slid_distance")
MIDDLE = 0.9  # share of a linear change between the quantiles 0.05 and 0.95 of its covariate, which trace reports

SizeOf = Callable[[float, float], float]
SIZES: Mapping[tuple[str, str], SizeOf] = {  # by kind and unit: the parameter, from the value and the table's friction
    ("contact_friction", "1"): lambda value, _: value,
    ("centre_of_friction", "m"): lambda value, _: abs(value),
    ("anisotropic_friction", "1"): lambda value, _: abs(value),
    ("body_anisotropy", "1"): lambda value, _: abs(value),
    ("tilted_surface", "N/N"): lambda value, friction: abs(value) / friction,
    ("tilted_surface", "of the weight"): lambda value, friction: abs(value) / friction,
    ("surface_friction", "1"): lambda value, _: expm1(value),
    ("surface_friction", "of its value"): lambda value, _: value,
    ("clock_offset", "s"): lambda value, _: value,
    ("frame_rotation", "rad"): lambda value, _: value,
}

# Older truths lack the friction. Only the foreign rig, whose centre of friction is exact, states its engine.
NEEDED = {"tilted_surface": "friction", "centre_of_friction": "engine"}


def covers(truth: Mapping[str, Any], effect: Mapping[str, Any], reported: Mapping[str, Any]) -> bool | None:
    """Whether the reported interval covers the true value of an effect; None if they are not compared.

    truth: of the recording. effect: the truth itself or its second effect. reported: one of the effects of a trace.
    """
    parameter, kind = reported.get("parameter"), effect["kind"]
    size_of = SIZES.get((kind, effect.get("unit", "")))
    if parameter is None or size_of is None or reported["mechanism"] != kind:
        return None
    if kind in NEEDED and NEEDED[kind] not in truth:
        return None
    share = _share(effect, reported)
    if share is None:
        return None
    true = size_of(share * float(effect["value"]), float(truth.get("friction", 1.0)))
    return bool(parameter["low"] <= true <= parameter["high"])


def _share(effect: Mapping[str, Any], reported: Mapping[str, Any]) -> float | None:
    """What the reported size is of the true one, by the forms of both; None if they do not have the same meaning."""
    true, form, covariate = _form(effect), reported["form"], reported["covariate"]
    if true == "constant":
        return 1.0 if form == "constant" or (form, covariate) == ("step", "session") else None
    if true != form:
        return None
    progress = covariate in PROGRESS and _in_progress(effect["covariates"])
    if true == "step":
        return 1.0 if progress or covariate in effect["covariates"] else None
    return MIDDLE if true == "linear" and progress else None


def _form(effect: Mapping[str, Any]) -> str:
    """The course, where the truth has one: there the form of a saturating course is linear."""
    return str(effect.get("course") or effect.get("form"))


def _in_progress(covariates: Collection[str]) -> bool:
    return any(name in PROGRESS for name in covariates)

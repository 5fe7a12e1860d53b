# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The size of an effect as numbers and in one clause: the shift of a window first, then the parameter."""

from __future__ import annotations

import numpy as np

from push_predictor.evaluation.estimate import Estimate, of_draws
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint
from push_predictor.models.pushes import Push
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.residuals.evidence.drivers import UNDRIVEN
from push_predictor.residuals.evidence.standardised import mechanics_under
from push_predictor.residuals.outcome import FoundEffect, Trace
from push_predictor.residuals.reporting import phrases as say
from push_predictor.types import Array

DRAWS = 500
USUAL = "contact_friction"  # the mechanism whose detectable size is shown if nothing was found
FORCE = "surface_friction"  # its size is a share of the force
NO_ENDS = ("periodic", "periodic, twice around", "category", "map")  # bases whose size is their largest difference
FIFTH = 0.2  # of the windows at either end of a covariate
SHOWN = {"dx": (1e3, "mm"), "dy": (1e3, "mm"), "dtheta": (float(np.degrees(1.0)), "deg"), "position": (1e3, "mm")}


def shift_sizes(trace: Trace, effect: Effect, table: PushTable) -> dict[str, Estimate]:
    """Root mean square shift of dx, dy, dtheta and the position over the windows of a table; m, m, rad, m.

    The 95 % intervals are of draws of the effect's coefficients.
    """
    on, push = mechanics_under(trace.model), Push.of(table)
    together = joint(on, [effect], push)
    shift, design = together.shift, together.designs[0]
    rng = np.random.default_rng(0)
    none = np.zeros_like(effect.coefficients)
    draws = rng.multivariate_normal(none, effect.covariance, DRAWS, method="svd")
    spread = np.array([_root_mean_square(shift + design @ draw) for draw in draws])
    low, high = np.quantile(spread, [0.025, 0.975], axis=0)
    size = _root_mean_square(shift)
    low, high = np.minimum(low, size), np.maximum(high, size)  # draws of a small effect are all larger than it
    ends = zip(size.tolist(), low.tolist(), high.tolist(), strict=True)
    return {name: Estimate(*each) for name, each in zip((*OUTPUTS, "position"), ends, strict=True)}


def noise_ratios(trace: Trace, effect: FoundEffect) -> dict[str, Estimate]:
    """By output: root mean square residual in the highest fifth of the covariate over that in the lowest.

    With 95 % intervals from a bootstrap of pushes; empty if the covariate is not recorded.
    """
    values = trace.analysis.covariates.get(effect.covariate)
    if values is None or len(trace.unexplained) != len(values):
        return {}
    low, high = (values <= np.quantile(values, FIFTH)), (values >= np.quantile(values, 1.0 - FIFTH))
    weights = np.vstack([np.ones(len(values)), push_bootstrap(trace.analysis.push_id)])
    ratios = {}
    for name in effect.outputs:
        square = trace.unexplained[:, OUTPUTS.index(name)] ** 2
        spread = [np.sqrt(weights @ (square * rows) / np.maximum(weights @ rows, 1.0)) for rows in (low, high)]
        ratio = spread[1] / np.maximum(spread[0], np.finfo(float).tiny)
        ratios[name] = of_draws(float(ratio[0]), ratio[1:])
    return ratios


def effect_size(trace: Trace, index: int, p_value: float | None = None) -> str:
    """How far an effect shifts a window, root mean square, then its parameter; to follow "it"."""
    effect = trace.effects[index]
    if index >= len(trace.terms):
        return _force_size(effect, p_value)
    sizes = shift_sizes(trace, trace.terms[index], trace.analysis)
    shifts = []
    for name in ("position", "dtheta"):
        size = sizes[name].times(SHOWN[name][0])
        alone = effect.parameter is None and p_value is not None  # without a parameter, the interval is that of a shift
        shifts.append(say.interval(size, SHOWN[name][1]) if alone else f"{size.value:.2g} {SHOWN[name][1]}")
    shift = f"shifts a window by {say.listed(shifts)}"
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


def largest_ratio(trace: Trace) -> str:
    """The largest ratio of an output's noise along the first effect's covariate."""
    effect = trace.effects[0]
    ratios = noise_ratios(trace, effect)
    if not ratios:
        return "its size is unknown"
    name, ratio = max(ratios.items(), key=lambda pair: abs(np.log(max(pair[1].value, 1e-9))))
    along = say.covariate_phrase(effect.covariate)
    text = f"from the lowest to the highest fifth of {along}, the noise of {name} changes by the factor"
    return f"{text} {say.interval(ratio)}"


def detectable(trace: Trace) -> str:
    """The smallest effect that would have been found."""
    name = USUAL if USUAL in trace.minimum_detectable else next(iter(trace.minimum_detectable), None)
    value = None if name is None else trace.minimum_detectable[name].get("value")
    if name is None or value is None:
        tried = say.count(len(trace.tested), "candidate", "candidates")
        return f"not one of {tried} explains the errors of these pushes"
    factor, unit = say.shown_unit(str(trace.minimum_detectable[name].get("unit", "")))
    size = f"{factor * float(value):.2g} {unit}".strip()
    return f"a change of {say.mechanism_phrase(name)} by {size} would have been found with 80 % probability"


def _force_size(effect: FoundEffect, p_value: float | None) -> str:
    if effect.parameter is None:
        return "has an unknown size"
    if effect.mechanism != FORCE:
        return f"has the size {say.interval(*say.in_shown_unit(effect.parameter), p_value)}"
    value = effect.parameter.estimate.times(100.0)
    if effect.covariate in UNDRIVEN:
        how = "larger" if value.value > 0.0 else "smaller"
        return f"is {say.interval(value.size(), '%', p_value)} {how} than in training"
    return f"changes by {say.interval(value, '%', p_value)} over the range of {say.covariate_phrase(effect.covariate)}"


def _root_mean_square(shift: Array) -> Array:
    """Of shifts (n, 3), by output and of the position (4,)."""
    square = np.mean(shift**2, axis=0)
    return np.asarray(np.sqrt([*square, square[0] + square[1]]))

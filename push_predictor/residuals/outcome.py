# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The result of a trace, all that its report shows, and its JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import hypot
from typing import Any, Literal

import numpy as np
from scipy.special import ndtri

from push_predictor.evaluation.estimate import Estimate, difference_by_push, total_nmse
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.evaluation.validation import Comparison, metrics_json
from push_predictor.models.effects.effect import Effect
from push_predictor.models.mechanisms import mechanism_named
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.evidence.drivers import between_ends
from push_predictor.residuals.evidence.input_shift import ShiftedInput
from push_predictor.types import Array

Verdict = Literal[
    "none", "effect", "driver_only", "mechanism_only", "wrench_only", "measurement", "variance", "input_shift"
]
Reference = Literal["deployed", "refit"]  # the model without the effects with which a gain compares
CHANNELS: dict[Verdict, str] = {
    "none": "none",
    "effect": "motion",
    "driver_only": "motion",
    "mechanism_only": "motion",
    "variance": "motion",
    "wrench_only": "wrench",
    "measurement": "measurement",
    "input_shift": "none",
}
# Relative standard deviation of a size by errors of the mechanics; more pushes do not reduce it. Chosen from misses on
# rigs with other laws of friction (benchmarks/blind/RESULTS.md).
DISCREPANCY = 0.025
DRAWS = 2000


@dataclass(frozen=True)
class Sized:
    """A physical parameter with its 95 % interval."""

    name: str
    value: float
    low: float
    high: float
    unit: str

    @property
    def estimate(self) -> Estimate:
        """The value with its interval, without name and unit."""
        return Estimate(self.value, self.low, self.high)

    def with_errors_of_mechanics(self) -> Sized:
        """The same with the interval widened by errors of the mechanics, which are independent of chance."""
        more = float(ndtri(0.975)) * DISCREPANCY * self.value
        low, high = self.value - hypot(self.value - self.low, more), self.value + hypot(self.high - self.value, more)
        return replace(self, low=low, high=high)


@dataclass(frozen=True)
class FoundEffect:
    """One effect of the JSON, on whatever channel it was found.

    mechanism: None if unknown; resembles: the one that comes closest then. basis: of the dependence on the covariate.
    p_value: family-wise. share_of_residual: of the sum of squares of the standardised residual.
    """

    mechanism: str | None
    covariate: str
    outputs: tuple[str, ...]
    basis: str
    parameter: Sized | None
    p_value: float
    share_of_residual: float
    resembles: str | None = None


@dataclass(frozen=True)
class Tested:
    """A candidate that was tried, with its family-wise p value."""

    mechanism: str | None
    covariate: str
    p_value: float


def best_of(labels: Sequence[tuple[str | None, str]], p_values: Sequence[float]) -> tuple[Tested, ...]:
    """Every mechanism with every covariate once, in its best basis, smallest p first."""
    best: dict[tuple[str | None, str], float] = {}
    for label, p in zip(labels, p_values, strict=True):
        best[label] = min(p, best.get(label, 1.0))
    return tuple(Tested(*label, p) for label, p in sorted(best.items(), key=lambda item: item[1]))


def in_trace(tested: Sequence[Tested], share: float) -> tuple[Tested, ...]:
    """Candidates of one channel with p values of the whole trace; share: of alpha, that the channel may spend."""
    return tuple(replace(one, p_value=min(1.0, one.p_value / share)) for one in tested)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The held-out pushes, predicted by the deployed model, by the refit and by the extended model.

    digest: SHA-256 of their rows, taken before they were first used.
    """

    table: PushTable
    before: Comparison
    refit: Comparison
    after: Comparison
    digest: str


@dataclass(frozen=True, eq=False, repr=False)
class Trace:
    """All that a trace found.

    effects: in the order of selection; terms: the same as effects of a model, then parts of these; empty if the mean
    of the motion is unchanged. equivalent: rivals of the first effect's covariate; mechanisms: rivals of its
    mechanism. analysis: the windows that were searched; residual (n, 3): their standardised residuals before;
    find_unexplained: computes those after, which only pages and sizes of noise need. gain_over: the better of the two
    models without the effects, with which the gain compares. extended: the model with the effects, None if the motion
    model does not change. remaining: mechanism and covariate of the strongest effect that is still significant.
    input_shift: inputs that differ from those of training. harmless: findings that change neither windows nor
    predictions. notes: further sentences for the reader.
    """

    verdict: Verdict
    kind: Literal["mean", "variance"] | None
    model: PushModel
    effects: tuple[FoundEffect, ...]
    terms: tuple[Effect, ...]
    equivalent: tuple[str, ...]
    mechanisms: tuple[str, ...]
    undecided: bool
    analysis: PushTable
    residual: Array
    find_unexplained: Callable[[], Array]
    held_out: HeldOut
    gain_nmse: Estimate
    gain_nlpd: Estimate
    gain_over: Reference
    extended: PushModel | None
    tested: tuple[Tested, ...]
    minimum_detectable: Mapping[str, Mapping[str, Any]]
    remaining: tuple[str | None, str] | None
    alpha: float
    input_shift: tuple[ShiftedInput, ...] = ()
    harmless: tuple[FoundEffect, ...] = ()
    notes: tuple[str, ...] = field(default=())

    @cached_property
    def unexplained(self) -> Array:
        """Standardised residuals (n, 3) of the analysis after the trace."""
        return self.find_unexplained()

    @property
    def relearnt(self) -> bool:
        """Whether the refit learns every effect on the mean motion, so that nothing was added to a model."""
        return bool(self.terms) and self.gain_nlpd.low == self.gain_nlpd.high == 0.0

    @cached_property
    def confirming_gain(self) -> Estimate:
        """The difference on held-out pushes that confirms the effects on the mean motion; below zero is better.

        It is that in NLPD by the extension. Where the refit learns every effect, it is that in NMSE by retraining: a
        refit also learns the new noise, which improves its NLPD without any effect on the mean.
        """
        if not self.relearnt:
            return self.gain_nlpd
        return difference_by_push(push_scores(self.held_out.before), push_scores(self.held_out.refit), total_nmse)

    @property
    def weak(self) -> bool:
        """Whether the held-out pushes do not confirm the effects on the mean motion beyond chance."""
        confirmed = self.confirming_gain.high < 0.0 and (self.relearnt or self.extended is not None)
        return bool(self.terms) and not confirmed

    @property
    def comparisons(self) -> list[Comparison]:
        """Comparisons of the held-out pushes named before, refit and, if something was added, after."""
        held = self.held_out
        pairs = [("before", held.before), ("refit", held.refit), ("after", held.after)]
        same = np.array_equal(held.refit.mean, held.after.mean)
        same = same and np.array_equal(held.refit.observed, held.after.observed)
        shown = pairs if self.terms or not same else pairs[:2]
        return [replace(comparison, model=name) for name, comparison in shown]

    def __repr__(self) -> str:
        """Verdict, effects and whether there is an extended model."""
        found = [f"{effect.mechanism or 'unknown mechanism'} by {effect.covariate}" for effect in self.effects]
        extended = "extended" if self.extended else "unchanged"
        return f"Trace of {self.model.name!r}: {self.verdict} ({', '.join(found) or 'no effect'}), model {extended}"


def size_of(effect: Effect, table: PushTable) -> Sized | None:
    """The mechanism's parameter, or its change along the covariate, with a 95 % interval; None if it is unknown.

    Constant: the parameter itself. One covariate: the change from its 5th to its 95th percentile. Headings, categories
    and maps: the largest difference over the windows. The size of several parameters is the length of their vector. The
    interval contains the errors of the mechanics, too.
    """
    if effect.mechanism is None:
        return None
    parameters = mechanism_named(effect.mechanism).parameters
    change = _change(effect, table)
    estimate = _length(effect.coefficients, change, len(parameters))
    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal(effect.coefficients, effect.covariance, size=DRAWS, method="svd")
    lengths = np.array([_length(row, change, len(parameters)) for row in drawn])
    low, high = np.quantile(lengths, [0.025, 0.975])
    sized = Sized(_name(effect), float(estimate), float(low), float(high), parameters[0].unit)
    sized = sized.with_errors_of_mechanics()
    return sized if len(parameters) == 1 else replace(sized, low=max(sized.low, 0.0))  # a length is never negative


def _name(effect: Effect) -> str:
    parameters = mechanism_named(str(effect.mechanism)).parameters
    many = f"{str(effect.mechanism).replace('_', ' ')}, length of its vector"
    name = parameters[0].name if len(parameters) == 1 else many
    return name if effect.basis.is_constant else f"{name}, change over {effect.covariate}"


def _change(effect: Effect, table: PushTable) -> Array:
    """Difference (m,) of the basis between the two ends that are compared."""
    basis = effect.basis
    if basis.is_constant:
        return np.ones(1)
    if (change := between_ends(basis, table)) is not None:
        return change
    values = basis.values(table.covariates, len(table))
    strength = values @ effect.coefficients.reshape(-1, values.shape[1])[0]
    return np.asarray(values[int(np.argmax(strength))] - values[int(np.argmin(strength))])


def _length(coefficients: Array, change: Array, count: int) -> float:
    """Change of one parameter with its sign, or the length of the change of several."""
    changes = coefficients.reshape(count, -1) @ change
    return float(changes[0]) if count == 1 else float(np.linalg.norm(changes))


def trace_json(trace: Trace) -> dict[str, Any]:
    """The JSON of a trace; unknown numbers are null, never NaN."""
    held_out = trace.held_out
    return {
        "verdict": trace.verdict,
        "input_shift": [
            {**vars(each), "training": list(each.training), "now": list(each.now)} for each in trace.input_shift
        ],
        "effect_present": trace.verdict != "none",
        "channel": CHANNELS[trace.verdict],
        "kind": trace.kind,
        "covariates": [effect.covariate for effect in trace.effects],
        "equivalent": list(trace.equivalent),
        "undecided": trace.undecided,
        "motion_model_changed": trace.extended is not None,
        "effects": [_effect(effect, trace.weak) for effect in trace.effects],
        "harmless": [
            {name: _effect(each, False)[name] for name in ("mechanism", "parameter")} for each in trace.harmless
        ],
        "before": metrics_json(held_out.before),
        "refit": metrics_json(held_out.refit),
        "after": metrics_json(held_out.after),
        "gain": {"nmse": trace.gain_nmse.json(), "nlpd": trace.gain_nlpd.json()},
        "gain_over": trace.gain_over,
        "minimum_detectable": {name: dict(size) for name, size in trace.minimum_detectable.items()},
        "remaining": {"effect_present": trace.remaining is not None, "strongest": _strongest(trace)},
        "experiment": [],  # of the contract; advice on further pushes is in words, on the page
        "tested": [vars(tested) for tested in trace.tested],
        "pushes": {"analysis": len(trace.analysis.pushes), "held_out": len(held_out.table.pushes)},
        "held_out_sha256": held_out.digest,
        "mechanisms": list(trace.mechanisms),
        "alpha": trace.alpha,
        "model": trace.model.name,
        "notes": list(trace.notes),
    }


def _effect(effect: FoundEffect, weak: bool) -> dict[str, Any]:
    return {
        "mechanism": effect.mechanism,
        "covariate": effect.covariate,
        "outputs": list(effect.outputs),
        "form": effect.basis,
        "parameter": None if effect.parameter is None else vars(effect.parameter),
        "p_value": effect.p_value,
        "share_of_residual": effect.share_of_residual,
        "resembles": effect.resembles,
        "weak": weak,
    }


def _strongest(trace: Trace) -> str | None:
    if trace.remaining is None:
        return None
    mechanism, covariate = trace.remaining
    return f"{mechanism or 'unknown mechanism'} driven by {covariate}"

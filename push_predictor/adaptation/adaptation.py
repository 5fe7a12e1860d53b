# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Follow a rig push by push: a model whose mechanics and noise change as the outcomes say.

What has changed is not known. So there is one hypothesis for "nothing", one for each mechanism alone, and one for all
of them together; each is a walk of its parameters, weighted by how well it predicted the pushes so far. Their mixture,
as one mean and covariance of all parameters, extends the deployed model by constant effects. What the model has learnt
beside its mechanics stays as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import combinations, pairwise
from typing import NamedTuple, TypeAlias

import numpy as np

from push_predictor.adaptation.walk import LARGEST_SQUARE, SPEEDS, Noise, Observed, Walk
from push_predictor.errors import RequestError
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import JointEffects
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.prior import NOISE_WINDOWS, ProcessNoise, normal_draws
from push_predictor.models.mechanisms import LIBRARY, REFINEMENTS, mechanism_named
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors import (
    ExtendedPredictor,
    GaussianProcessPredictor,
    Predictor,
    PriorPredictor,
)
from push_predictor.models.predictors.tails import Tails, half_widths
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.request import check_pushes
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, IntArray

USUAL = ("contact_friction", "contact_asymmetry", "pressure_spread", "centre_of_friction", "body_anisotropy")
UNCHANGED = 0.95  # probability that nothing has changed before the first push
FORGOTTEN = 6.0  # nats: no hypothesis falls further behind the best, so that a later change is found
SPREAD = 1.5  # standard deviation of a change in units of PARAMETERS' spread
TRAINED_NOISE = 40.0  # independent windows that the deployed model's noise is worth
NEGLIGIBLE = 0.05  # such standard deviations: a change this small and certain is left out
ACCURACY = 3e-3  # of displacements, relative
CERTAIN = 1.96
LEVELS = 200  # quantiles of which a mean is taken
CONSTANT = DriverBasis("constant")
# From inputs (n, 3), durations (n,) and covariates to predictions.
Predict: TypeAlias = Callable[[Array, Array, Mapping[str, Array]], Prediction]


class AdaptedParameter(NamedTuple):
    """A parameter as it is now, with a 95 % interval, and as it was when the model was trained; in `unit`."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    deployed: float

    @property
    def changed(self) -> bool:
        """Whether the interval leaves out the deployed value."""
        return not self.low <= self.deployed <= self.high

    def __str__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        now = f"{self.name.replace('_', ' ')} {self.value:.2g}{unit} ({self.low:.2g} to {self.high:.2g})"
        return f"{now}, {self.deployed:.2g} when trained"


class Adaptation:
    """A deployed model and what its pushes since have shown.

    mechanisms: names of those that may change (models/mechanisms.py). Those in the world need pushes with
    `slider_heading`. speed: of the random walk, in standard deviations of a change per push; None: learnt. A prior
    model follows in its own parameters. predict: predictions of the model from its table, if there is one. Raises
    RequestError for a model without mechanics, an unknown mechanism, or a speed that is not a finite number >= 0.
    """

    def __init__(
        self,
        model: PushModel,
        mechanisms: Sequence[str] = USUAL,
        speed: float | None = None,
        predict: Predict | None = None,
    ) -> None:
        _check(model, mechanisms, speed)
        self.deployed, self.pushes = model, 0
        self._predict = predict or model.predict_rows
        self._adapted: PushModel | None = None
        base = model.predictor.base
        self._mechanisms = () if isinstance(base, PriorPredictor) else tuple(mechanisms)
        if isinstance(base, PriorPredictor):
            names, self._groups = tuple(base.fitted.values), [np.arange(len(base.fitted.values))]
            covariance, windows = base.fitted.covariance, NOISE_WINDOWS
        else:
            names = tuple(name for each in mechanisms for name in mechanism_named(each).quantities)
            self._groups = _hypotheses(mechanisms)
            covariance, windows = np.diag(_spreads(mechanisms) ** 2), TRAINED_NOISE
        fitted = base.mechanics
        self._names, self._values = names, np.array([fitted.value(name) for name in names])
        self._mechanics = replace(fitted, mechanics=replace(fitted.mechanics, accuracy=ACCURACY))
        low, high = (
            np.array([getattr(BY_NAME[name], end) for name in names]) - self._values for end in ("low", "high")
        )
        noise = Noise(windows, _usual_square(model.predictor.tails))
        speeds = SPEEDS if speed is None else {speed: 1.0}
        self._walks = [
            Walk.start(covariance[np.ix_(own, own)], low[own], high[own], noise, speeds) for own in self._groups
        ]
        others = max(len(self._groups) - 1, 1)
        self._log_weight = np.log([UNCHANGED, *[(1.0 - UNCHANGED) / others] * others][: len(self._groups)])

    def update(self, windows: PushTable) -> None:
        """Take in the n windows of one push.

        Raises RequestError if there are none, if they belong to several pushes, or lack a covariate that is needed.
        """
        if len(windows.pushes) != 1:
            raise RequestError("windows", f"of {len(windows.pushes)} pushes", "those of one push")
        for name in self._needs:
            if name not in windows.covariates:
                raise RequestError("windows", f"without {name}", "those with what the mechanisms need")
        check_pushes(self.deployed, windows)
        push = self.deployed.predictor.completed(Push.of(windows))
        mean, covariance = self._deployed_moments(push)
        observed = Observed(windows.outcomes - mean, covariance)
        view = _View(self._mechanics, self._old, self._names, push)
        log_density = np.empty(len(self._groups))
        for k, own in enumerate(self._groups):
            self._walks[k], log_density[k] = self._walks[k].after(observed, partial(view.shift, own))
        weight = self._log_weight + log_density
        weight = np.maximum(weight - weight.max(), -FORGOTTEN)
        self._log_weight = weight - np.log(np.exp(weight).sum())
        self.pushes, self._adapted = self.pushes + 1, None

    def __str__(self) -> str:
        changed = [str(parameter) for parameter in self.parameters if parameter.changed]
        found = "; ".join(changed) or "no parameter has certainly changed"
        alarm = "; the last push needs parameters that no rig has" if self.out_of_range else ""
        return f"{found}, after {self.pushes} push{'es' * (self.pushes != 1)}{alarm}"

    @property
    def parameters(self) -> list[AdaptedParameter]:
        """The parameters that follow, in the order of the mechanisms."""
        change, covariance = self._change
        half = CERTAIN * np.sqrt(np.diagonal(covariance))
        now = self._values + change
        columns = zip((BY_NAME[name] for name in self._names), now, now - half, now + half, self._values, strict=True)
        return [
            AdaptedParameter(p.name, p.unit, value, max(low, p.low), min(high, p.high), deployed)
            for p, value, low, high, deployed in columns
        ]

    @property
    def noise(self) -> Array:
        """Factor (3,) on the deployed standard deviations of dx, dy and dtheta."""
        return np.asarray(np.sqrt(self._weights @ [walk.noise.factor for walk in self._walks]))

    @property
    def out_of_range(self) -> bool:
        """Whether the last push needs parameters that no rig has: not followed, a reason to look at the rig."""
        return self._walks[int(np.argmax(self._log_weight))].refused

    @property
    def adapted(self) -> PushModel:
        """The deployed model as the rig is now, with `_adapted` after its name; it predicts, and saves, like others."""
        if self._adapted is None:
            self._adapted = replace(self.deployed, name=adapted_name(self.deployed.name), predictor=self._predictor())
        return self._adapted

    def _predictor(self) -> Predictor:
        change, covariance = self._change
        base, predictor = self.deployed.predictor.base, self.deployed.predictor
        if isinstance(base, PriorPredictor):
            values = dict(zip(self._names, (self._values + change).tolist(), strict=True))
            fitted = FittedMechanics(base.fitted.mechanics, values, covariance)
            noise = ProcessNoise(base.noise.factor * self.noise**2)
            return PriorPredictor(fitted, normal_draws(fitted, self.deployed.provenance.seed), noise)
        effects, cross = _constant_effects(self._mechanisms, change, covariance)
        had = len(predictor.effects)
        cross = {(had + i, had + j): shared for (i, j), shared in cross.items()}
        if isinstance(predictor, ExtendedPredictor):
            joined = (*predictor.effects, *effects)
            return replace(
                predictor, effects=joined, cross={**predictor.cross, **cross}, scale=predictor.scale * self.noise
            )
        return ExtendedPredictor(predictor, effects, self.noise, cross)

    @cached_property
    def _needs(self) -> set[str]:
        """Covariates that the mechanisms need."""
        return {name for each in self._mechanisms for name in mechanism_named(each).needs}

    @cached_property
    def _old(self) -> JointEffects:
        """Effects of the mechanics that the deployed model has already."""
        return JointEffects.of(self.deployed.predictor.effects)

    def _deployed_moments(self, push: Push) -> tuple[Array, Array]:
        """Mean (n, 3) and covariance (n, 3, 3) under the deployed parameters."""
        predictor = self.deployed.predictor
        if isinstance(predictor, PriorPredictor):
            mean = predictor.fitted.displacement(push.inputs, push.duration, push.covariates)
            return mean, predictor.process_covariance(push)
        found = self._predict(push.inputs, push.duration, push.covariates)
        # A learnt model's outputs are taken one by one, see residuals/evidence/standardised.py.
        return found.mean, found.covariance * np.eye(3) if predictor.learnt else found.covariance

    @property
    def _weights(self) -> Array:
        return np.exp(self._log_weight)

    @property
    def _change(self) -> tuple[Array, Array]:
        """Mean (p,) and covariance (p, p) of the change of all parameters, of the mixture of hypotheses."""
        p, weights = len(self._names), self._weights
        means, covariance = np.zeros((len(weights), p)), np.zeros((p, p))
        for k, (own, walk) in enumerate(zip(self._groups, self._walks, strict=True)):
            means[k, own] = walk.mean
            covariance[np.ix_(own, own)] += weights[k] * walk.covariance
        mean = weights @ means
        away = means - mean
        return mean, covariance + np.einsum("s,sp,sq->pq", weights, away, away)


def adapted_name(name: str) -> str:
    """The name of the adapted model."""
    return f"{name}_adapted"


class _View:
    """What changes of some parameters do to a push of a model."""

    def __init__(self, mechanics: FittedMechanics, old: JointEffects, names: tuple[str, ...], push: Push) -> None:
        self._mechanics, self._names, self._push = mechanics, names, push
        n = len(push.inputs)
        self._old_names = old.names if old.effects else ()
        self._old = old.changes(old.columns(push)) if old.effects else np.zeros((n, 0))
        self._unchanged = self._shifted(self._old_names, self._old, derivatives=False)[0] if old.effects else 0.0

    def shift(self, own: IntArray, change: Array) -> tuple[Array, Array]:
        """Shift (n, 3) of the mean by changes (p,) of the parameters `own`, and derivatives (n, 3, p)."""
        n, names = len(self._push.inputs), [self._names[k] for k in own]
        if not names:
            return np.zeros((n, 3)), np.zeros((n, 3, 0))
        together = (*names, *(name for name in self._old_names if name not in names))
        changes = np.zeros((n, len(together)))
        changes[:, : len(names)] = change
        changes[:, [together.index(name) for name in self._old_names]] += self._old
        moved, slopes = self._shifted(together, changes)
        return moved - self._unchanged, slopes[:, : len(names)].transpose(0, 2, 1)

    def _shifted(self, names: tuple[str, ...], changes: Array, *, derivatives: bool = True) -> tuple[Array, Array]:
        return self._mechanics.shifted(names, changes, self._push, derivatives=derivatives)


def _hypotheses(mechanisms: Sequence[str]) -> list[IntArray]:
    """The columns of the parameters that change: none, those of each mechanism, all."""
    counts = [len(mechanism_named(name).quantities) for name in mechanisms]
    each = np.split(np.arange(sum(counts)), np.cumsum(counts)[:-1])
    return [np.arange(0), *each, *([np.arange(sum(counts))] if len(counts) > 1 else [])]


def _usual_square(tails: Tails | None) -> Array:
    """See Noise."""
    levels = (np.arange(LEVELS) + 0.5) / LEVELS
    squares = [np.minimum(half_widths(tails, level) ** 2, LARGEST_SQUARE) for level in levels.tolist()]
    return np.asarray(np.mean(squares, axis=0))


def _constant_effects(
    mechanisms: Sequence[str], change: Array, covariance: Array
) -> tuple[tuple[Effect, ...], dict[tuple[int, int], Array]]:
    """Effects that are the same for every push, and the covariance of each two.

    A mechanism that has hardly changed, and is nearly certain not to have, is left out: it would cost time.
    """
    ends = np.cumsum([0, *(len(mechanism_named(name).quantities) for name in mechanisms)])
    size = np.sqrt(change**2 + np.diagonal(covariance)) / _spreads(mechanisms)
    parts = [(name, slice(*ends)) for name, ends in zip(mechanisms, pairwise(ends.tolist()), strict=True)]
    parts = [(name, own) for name, own in parts if np.any(size[own] > NEGLIGIBLE)]
    effects = tuple(
        Effect(name, "constant", CONSTANT, change[own], covariance[own, own], np.ones(3)) for name, own in parts
    )
    pairs = combinations(range(len(parts)), 2)
    return effects, {(i, j): covariance[parts[i][1], parts[j][1]] for i, j in pairs}


def _spreads(mechanisms: Sequence[str]) -> Array:
    """Prior standard deviations (p,) of changes of the parameters of mechanisms."""
    return np.array([SPREAD * BY_NAME[name].spread for each in mechanisms for name in mechanism_named(each).quantities])


def _check(model: PushModel, mechanisms: Sequence[str], speed: float | None) -> None:
    base = model.predictor.base
    if isinstance(base, GaussianProcessPredictor) and base.mean is None:
        raise RequestError("model", model.name, "a model about mechanics: it has learnt the outcomes without them")
    if not mechanisms or {*mechanisms} - {*_NAMES} or len({*mechanisms}) < len(mechanisms):
        raise RequestError("mechanisms", list(mechanisms), f"some of {', '.join(_NAMES)}, each once")
    if speed is not None and not (np.isfinite(speed) and speed >= 0.0):
        raise RequestError("speed", speed, "a finite number >= 0")


_NAMES = tuple(mechanism.name for mechanism in (*LIBRARY, *REFINEMENTS))

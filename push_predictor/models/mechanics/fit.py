# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Joint fit of the forward model's parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from push_predictor.errors import TrainingError
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME, MechanicsParameter
from push_predictor.types import Array, IntArray

DEGREES = 4.0  # of freedom of Student's t: single windows that slip or hit a corner must not decide
MOST_STEPS = 12
CONVERGED = 0.02  # nats: a step that gains less is the last
NEARLY_CONVERGED = 0.5  # the same while parameters are chosen
LONG_STEP = 0.5  # prior standard deviations
DIFFERENCE = 0.05  # prior standard deviations
SHORTENINGS = 6


@dataclass(frozen=True, eq=False)
class FitRows:
    """Windows for a fit: inputs (n, 3), duration (n,) s, outcomes (n, 3) m, m, rad, push (n,) numbers from 0."""

    inputs: Array
    duration: Array
    outcomes: Array
    push: IntArray
    covariates: Mapping[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.duration)
        if n < 2 or np.shape(self.inputs) != (n, 3) or np.shape(self.outcomes) != (n, 3):
            raise TrainingError(
                f"rows: inputs {np.shape(self.inputs)}, duration {np.shape(self.duration)}, outcomes "
                f"{np.shape(self.outcomes)} are not accepted, give (n, 3), (n,), (n, 3) with n of at least 2"
            )
        if not all(np.all(np.isfinite(values)) for values in (self.inputs, self.duration, self.outcomes)):
            raise TrainingError("rows: a value is not finite, give finite inputs, durations and outcomes")

    @property
    def pushes(self) -> int:
        """Number of pushes."""
        return int(self.push.max()) + 1


@dataclass(frozen=True, eq=False)
class JointFit:
    """Parameters fitted together.

    values: by name, of the free parameters. residuals (n, 3): outcomes less displacements. scale (3,): of the
    residuals, by Student's t. jacobian (n, 3, p): derivatives of the displacement in the order of `names`.
    """

    rows: FitRows
    names: tuple[str, ...]
    values: dict[str, float]
    residuals: Array
    scale: Array
    jacobian: Array

    @property
    def covariance(self) -> Array:
        """Covariance (p, p) of the values from push to push: the jackknife over pushes, each a Gauss-Newton step.

        Few pushes decide on some parameters, such as friction, which only those show that slip. The sandwich estimate
        is then too small, because the residuals of these pushes have shrunk.
        """
        change = self.without_pushes
        return np.asarray(change.T @ change * (1.0 - 1.0 / self.rows.pushes))

    @cached_property
    def without_pushes(self) -> Array:
        """Change (pushes, p) of the values when a push is left out of the fit, by a Gauss-Newton step."""
        scaled = self.residuals / self.scale
        weight, bend = student_weights(scaled) / self.scale**2, student_curvature(scaled) / self.scale**2
        curvature = _curvature(self.jacobian, bend, _parameters(self.names))
        change = np.zeros((self.rows.pushes, len(self.names)))
        for push in range(self.rows.pushes):
            of_push = self.rows.push == push
            jacobian = self.jacobian[of_push]
            slope = np.einsum("nkp,nk,nk->p", jacobian, weight[of_push], self.residuals[of_push])
            without = curvature - np.einsum("nkp,nk,nkq->pq", jacobian, bend[of_push], jacobian)
            change[push] = -np.linalg.solve(without, slope)
        return change


def fit_jointly(
    mechanics: PushMechanics, rows: FitRows, names: Sequence[str], start: Mapping[str, float] | None = None
) -> JointFit:
    """Fit the parameters `names` together, from their textbook values or `start`; the others are the textbook's.

    Maximises the likelihood of Student's t noise with one scale per output and the weak normal priors of
    parameters.PARAMETERS, within the plausible ranges, by Gauss-Newton steps that are shortened until they help.
    Deterministic. Raises TrainingError for a name that is no parameter.
    """
    if unknown := [name for name in names if name not in BY_NAME]:
        raise TrainingError(f"{unknown[0]!r} is no parameter of the mechanics, give some of {', '.join(BY_NAME)}")
    problem = _Problem(mechanics, rows, tuple(names))
    values = problem.within(np.array([(start or {}).get(name, BY_NAME[name].textbook) for name in names]))
    return problem.solved(values, problem.residuals(values), None)


def refit(mechanics: PushMechanics, fit: JointFit, names: Sequence[str]) -> JointFit:
    """Fit some of the parameters of `fit`, and no others, from its values and derivatives, to NEARLY_CONVERGED."""
    columns = [fit.names.index(name) for name in names]
    problem = _Problem(mechanics, fit.rows, tuple(names))
    values = np.array([fit.values[name] for name in names])
    same = all(fit.values[p.name] == p.textbook for p in _parameters(fit.names) if p.name not in names)
    residuals = fit.residuals if same else problem.residuals(values)
    return problem.solved(values, residuals, fit.jacobian[:, :, columns], NEARLY_CONVERGED)


def with_candidates(mechanics: PushMechanics, fit: JointFit, candidates: Sequence[str]) -> JointFit:
    """The fit with further parameters at their textbook values, and their derivatives."""
    names = (*fit.names, *candidates)
    problem = _Problem(mechanics, fit.rows, names)
    values = np.array([*fit.values.values(), *(p.textbook for p in _parameters(candidates))])
    added = problem.jacobian(values, fit.residuals, only=candidates)
    return JointFit(
        fit.rows,
        names,
        dict(zip(names, values.tolist(), strict=True)),
        fit.residuals,
        fit.scale,
        np.concatenate([fit.jacobian, added], axis=2),
    )


def held_out_residuals(mechanics: PushMechanics, fit: JointFit) -> Array:
    """Residuals (n, 3) of each push under the parameters fitted without it; no parameter moves by more than its prior's
    standard deviation.

    The displacement is computed again: where a tip is close to a corner, derivatives hold for tiny changes only.
    """
    free = _parameters(fit.names)
    spread, low, high = (np.array([getattr(p, field) for p in free]) for field in ("spread", "low", "high"))
    change = np.clip(fit.without_pushes, -spread, spread)
    values = np.clip(np.array(list(fit.values.values())) + change, low, high)[fit.rows.push]
    rows, given = fit.rows, dict(zip(fit.names, values.T, strict=True))
    return np.asarray(rows.outcomes - mechanics.displacement(given, rows.inputs, rows.duration, rows.covariates))


def student_scale(residuals: Array) -> Array:
    """Scale (k,) of Student's t for residuals (n, k) about zero, by its maximum likelihood."""
    scale = np.sqrt(np.mean(residuals**2, axis=0)) + np.finfo(np.float64).tiny
    for _ in range(50):
        scale = np.sqrt(np.mean(student_weights(residuals / scale) * residuals**2, axis=0)) + np.finfo(np.float64).tiny
    return np.asarray(scale)


def student_weights(scaled: Array) -> Array:
    """Weights with which residuals in units of their scale enter a least squares step."""
    return np.asarray((DEGREES + 1.0) / (DEGREES + scaled**2))


def student_curvature(scaled: Array) -> Array:
    """Weights with the mean of the loss's second derivative, for each output: those of the least squares are larger.

    A fit to other rows moves by a step with these. Single second derivatives can be negative, so all are in proportion.
    """
    weight = student_weights(scaled)
    second = weight - 2.0 * (weight * scaled) ** 2 / (DEGREES + 1.0)
    return np.asarray(weight * np.maximum(second.mean(axis=0) / weight.mean(axis=0), 0.1))


def student_loss(scaled: Array) -> Array:
    """Negative log density of residuals in units of their scale, up to a constant."""
    return np.asarray(0.5 * (DEGREES + 1.0) * np.log1p(scaled**2 / DEGREES))


def _curvature(jacobian: Array, weight: Array, free: Sequence[MechanicsParameter]) -> Array:
    prior = np.array([parameter.spread for parameter in free]) ** -2.0
    return np.asarray(np.einsum("nkp,nk,nkq->pq", jacobian, weight, jacobian) + np.diag(prior))


class _Problem:
    """Residuals, derivatives and steps of a joint fit."""

    def __init__(self, mechanics: PushMechanics, rows: FitRows, names: tuple[str, ...]) -> None:
        self.mechanics, self.rows, self.names = mechanics, rows, names
        table = _parameters(names)
        self.low, self.high = np.array([p.low for p in table]), np.array([p.high for p in table])
        self.spread, self.textbook = np.array([p.spread for p in table]), np.array([p.textbook for p in table])

    def within(self, values: Array) -> Array:
        """The values, moved into their plausible ranges."""
        return np.clip(values, self.low, self.high) if self.names else values

    def residuals(self, values: Array) -> Array:
        """Outcomes less displacements, (n, 3)."""
        rows, given = self.rows, dict(zip(self.names, values.tolist(), strict=True))
        return rows.outcomes - self.mechanics.displacement(given, rows.inputs, rows.duration, rows.covariates)

    def jacobian(self, values: Array, residuals: Array, only: Sequence[str] | None = None) -> Array:
        """Derivatives of the displacement by the parameters, (n, 3, p), by differences away from a bound."""
        wanted = [k for k, name in enumerate(self.names) if only is None or name in only]
        derivatives = np.zeros((*residuals.shape, len(self.names)))
        step = DIFFERENCE * self.spread
        step = np.where(values + step > self.high, -step, step)
        for k in wanted:
            moved = values.copy()
            moved[k] += step[k]
            derivatives[:, :, k] = (residuals - self.residuals(moved)) / step[k]
        return derivatives[:, :, wanted]

    def solved(self, values: Array, residuals: Array, jacobian: Array | None, enough: float = CONVERGED) -> JointFit:
        """The fit from a start: steps are taken until one with derivatives of this point gains less than `enough`."""
        scale, fresh = student_scale(residuals), False
        for _ in range(MOST_STEPS if self.names else 0):
            if jacobian is None:
                jacobian, fresh = self.jacobian(values, residuals), True
            stepped, residuals, fall = self._stepped(values, residuals, scale, jacobian)
            moved = float(np.max(np.abs(stepped - values) / self.spread))
            values, scale = stepped, student_scale(residuals)
            if fall < enough and fresh:
                break
            jacobian, fresh = (None if fall < enough or moved > LONG_STEP else jacobian), False
        if jacobian is None or not fresh:
            jacobian = self.jacobian(values, residuals)
        named = dict(zip(self.names, values.tolist(), strict=True))
        return JointFit(self.rows, self.names, named, residuals, scale, jacobian)

    def _stepped(self, values: Array, residuals: Array, scale: Array, jacobian: Array) -> tuple[Array, Array, float]:
        """Values and residuals after a step, shortened until the objective falls, and its fall in nats."""
        change = self._change(values, residuals, scale, jacobian)
        before = self._objective(values, residuals, scale)
        for k in range(SHORTENINGS):
            trial = self.within(values + change * 0.4**k)
            after = self.residuals(trial)
            if (fall := before - self._objective(trial, after, scale)) > 0.0:
                return trial, after, fall
        return values, residuals, 0.0

    def _change(self, values: Array, residuals: Array, scale: Array, jacobian: Array) -> Array:
        """A Gauss-Newton step of the penalised, reweighted least squares, (p,)."""
        weight = student_weights(residuals / scale) / scale**2
        pull = self.spread**-2.0 * (self.textbook - values)
        slope = np.einsum("nkp,nk,nk->p", jacobian, weight, residuals) + pull
        return np.asarray(np.linalg.solve(_curvature(jacobian, weight, _parameters(self.names)), slope))

    def _objective(self, values: Array, residuals: Array, scale: Array) -> float:
        return float(
            student_loss(residuals / scale).sum() + 0.5 * np.sum(((values - self.textbook) / self.spread) ** 2)
        )


def _parameters(names: Sequence[str]) -> list[MechanicsParameter]:
    return [BY_NAME[name] for name in names]

"""Joint fit of the forward model's parameters, and how well a choice of them predicts held-out pushes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from push_predictor.errors import TrainingError
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.types import Array, BoolArray, IntArray

DEGREES = 4.0  # of freedom of Student's t: single windows that slip or hit a corner must not decide
MOST_STEPS = 12
CONVERGED = 0.01  # prior standard deviations
LONG_STEP = 0.5  # prior standard deviations
DIFFERENCE = 0.05  # prior standard deviations
FOLDS = 10
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
        """Covariance (p, p) of the values from push to push: the sandwich estimate, small-sample corrected."""
        weight = _weights(self.residuals / self.scale) / self.scale**2
        curvature = _curvature(self.jacobian, weight, self.names)
        slopes = np.einsum("nkp,nk,nk->np", self.jacobian, weight, self.residuals)
        of_push = np.zeros((self.rows.pushes, len(self.names)))
        np.add.at(of_push, self.rows.push, slopes)
        spread = of_push.T @ of_push * (self.rows.pushes / max(self.rows.pushes - len(self.names), 1))
        bread = np.linalg.inv(curvature)
        return np.asarray(bread @ spread @ bread)

    @property
    def effective_parameters(self) -> float:
        """How many of the parameters the rows determine, and not the priors."""
        weight = _weights(self.residuals / self.scale) / self.scale**2
        curvature = _curvature(self.jacobian, weight, self.names)
        prior = np.array([BY_NAME[name].spread for name in self.names]) ** -2.0
        return len(self.names) - float(np.sum(np.diagonal(np.linalg.inv(curvature)) * prior))


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
    """Fit some of the parameters of `fit`, and no others, from its values and derivatives."""
    columns = [fit.names.index(name) for name in names]
    problem = _Problem(mechanics, fit.rows, tuple(names))
    return problem.solved(np.array([fit.values[n] for n in names]), fit.residuals, fit.jacobian[:, :, columns])


def with_candidates(mechanics: PushMechanics, fit: JointFit, candidates: Sequence[str]) -> JointFit:
    """The fit with further parameters at their textbook values, and their derivatives."""
    names = (*fit.names, *candidates)
    problem = _Problem(mechanics, fit.rows, names)
    values = np.array([*fit.values.values(), *(BY_NAME[name].textbook for name in candidates)])
    added = problem.jacobian(values, fit.residuals, only=candidates)
    return JointFit(
        fit.rows,
        names,
        dict(zip(names, values.tolist(), strict=True)),
        fit.residuals,
        fit.scale,
        np.concatenate([fit.jacobian, added], axis=2),
    )


def held_out_scores(fit: JointFit, names: Sequence[str]) -> Array:
    """Score (pushes,) of each push under the parameters fitted without its fold: negative log of Student's t.

    Up to a constant. Each fold's fit is one Gauss-Newton step from the joint one, the scale that of `fit`.
    """
    columns = [fit.names.index(name) for name in names]
    jacobian, push = fit.jacobian[:, :, columns], fit.rows.push
    fold = np.random.default_rng(0).permutation(fit.rows.pushes) % min(FOLDS, fit.rows.pushes)
    score = np.zeros(len(push))
    values = np.array([fit.values[name] for name in names])
    problem_step = _Step(tuple(names), fit.scale)
    for k in range(int(fold.max()) + 1):
        held = fold[push] == k
        moved = problem_step.of(jacobian, fit.residuals, values, ~held) if names else np.zeros(0)
        left = fit.residuals[held] - jacobian[held] @ moved
        score[held] = _loss(left / fit.scale).sum(axis=1)
    return np.bincount(push, score).astype(np.float64)


def student_scale(residuals: Array) -> Array:
    """Scale (k,) of Student's t for residuals (n, k) about zero, by its maximum likelihood."""
    scale = np.sqrt(np.mean(residuals**2, axis=0)) + np.finfo(np.float64).tiny
    for _ in range(50):
        scale = np.sqrt(np.mean(_weights(residuals / scale) * residuals**2, axis=0)) + np.finfo(np.float64).tiny
    return np.asarray(scale)


def _weights(scaled: Array) -> Array:
    return np.asarray((DEGREES + 1.0) / (DEGREES + scaled**2))


def _loss(scaled: Array) -> Array:
    return np.asarray(0.5 * (DEGREES + 1.0) * np.log1p(scaled**2 / DEGREES))


def _curvature(jacobian: Array, weight: Array, names: Sequence[str]) -> Array:
    prior = np.array([BY_NAME[name].spread for name in names]) ** -2.0
    return np.asarray(np.einsum("nkp,nk,nkq->pq", jacobian, weight, jacobian) + np.diag(prior))


@dataclass(frozen=True, eq=False)
class _Step:
    """Gauss-Newton steps of the penalised, reweighted least squares."""

    names: tuple[str, ...]
    scale: Array

    def of(self, jacobian: Array, residuals: Array, values: Array, used: BoolArray | None = None) -> Array:
        """Change (p,) of the values; used (n,): rows that count."""
        weight = _weights(residuals / self.scale) / self.scale**2
        if used is not None:
            weight = weight * used[:, None]
        prior = np.array([BY_NAME[name].spread for name in self.names]) ** -2.0
        textbook = np.array([BY_NAME[name].textbook for name in self.names])
        slope = np.einsum("nkp,nk,nk->p", jacobian, weight, residuals) + prior * (textbook - values)
        return np.asarray(np.linalg.solve(_curvature(jacobian, weight, self.names), slope))


class _Problem:
    """Residuals, derivatives and steps of a joint fit."""

    def __init__(self, mechanics: PushMechanics, rows: FitRows, names: tuple[str, ...]) -> None:
        self.mechanics, self.rows, self.names = mechanics, rows, names
        table = [BY_NAME[name] for name in names]
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
        columns = []
        for k, name in enumerate(self.names):
            if only is None or name in only:
                step = (
                    DIFFERENCE
                    * self.spread[k]
                    * (-1.0 if values[k] + DIFFERENCE * self.spread[k] > self.high[k] else 1.0)
                )
                moved = values.copy()
                moved[k] += step
                columns.append((residuals - self.residuals(moved)) / step)
        return np.stack(columns, axis=2) if columns else np.zeros((*residuals.shape, 0))

    def solved(self, values: Array, residuals: Array, jacobian: Array | None) -> JointFit:
        """The fit from a start. Derivatives are taken again after a long step, and at the end."""
        scale, moved = student_scale(residuals), np.inf
        for _ in range(MOST_STEPS if self.names else 0):
            if jacobian is None:
                jacobian = self.jacobian(values, residuals)
            stepped, residuals = self._stepped(values, residuals, scale, jacobian)
            moved = float(np.max(np.abs(stepped - values) / self.spread))
            values, scale = stepped, student_scale(residuals)
            if moved < CONVERGED:
                break
            if moved > LONG_STEP:
                jacobian = None
        jacobian = self.jacobian(values, residuals)
        named = dict(zip(self.names, values.tolist(), strict=True))
        return JointFit(self.rows, self.names, named, residuals, scale, jacobian)

    def _stepped(self, values: Array, residuals: Array, scale: Array, jacobian: Array) -> tuple[Array, Array]:
        """Values and residuals after a step, shortened until the objective falls; the same if none helps."""
        change, before = (
            _Step(self.names, scale).of(jacobian, residuals, values),
            self._objective(values, residuals, scale),
        )
        for k in range(SHORTENINGS):
            trial = self.within(values + change * 0.4**k)
            after = self.residuals(trial)
            if self._objective(trial, after, scale) < before:
                return trial, after
        return values, residuals

    def _objective(self, values: Array, residuals: Array, scale: Array) -> float:
        return float(_loss(residuals / scale).sum() + 0.5 * np.sum(((values - self.textbook) / self.spread) ** 2))

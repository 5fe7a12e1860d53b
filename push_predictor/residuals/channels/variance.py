# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The variance channel: covariates that the noise of the outcomes depends on, after effects on the mean.

The test uses squared residuals, bounded so that a few outlying pushes decide nothing. The inputs are regressed out as
in the search on the mean. With a learnt base, a relation counts only as far as it differs from that in training.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.residuals.channels.contrast import MAD_TO_SD
from push_predictor.residuals.evidence.drivers import CONSTANT, screening_bases
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.residualizer import Residualizer, sums_by
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.selection.baseline import Baseline, difference, raised
from push_predictor.residuals.selection.power import QUANTILE
from push_predictor.residuals.selection.screening import Controlled, Scores, Screened, screen
from push_predictor.types import Array

TINY = 1e-12
MOST = 9.0  # of a square, three standard deviations: guards against a few windows far off
TRIED = (OUTPUTS, *((name,) for name in OUTPUTS))  # all outputs, then each
NOTABLE = 1.2  # least ratio: guards against a base that saw few pushes and misjudges its own noise a little


@dataclass(frozen=True, eq=False)
class VarianceEffect:
    """An effect on the variance of some outputs, with its family-wise p value.

    ratio: largest over smallest standard deviation of the residuals along the covariate, as fitted; for a constant
    effect, new data over training data.
    """

    covariate: str
    basis: DriverBasis
    outputs: tuple[str, ...]
    p_value: float
    ratio: float


@dataclass(frozen=True, eq=False)
class VarianceFinding:
    """Significant effects, strongest first, one per covariate.

    rivals: covariates that are no longer significant after the trend of the first is removed. detectable: the smallest
    ratio to training that would have been found with 80 % probability, NaN without training windows.
    """

    found: tuple[VarianceEffect, ...] = ()
    rivals: tuple[str, ...] = ()
    detectable: float = float("nan")


Trial = tuple[VarianceEffect, Scores]


@dataclass(frozen=True, eq=False)
class _Squares:
    """Residuals (n, 3) after regression on the model's inputs, with their table and their bounded squares."""

    residual: Array
    table: PushTable
    bounded: Controlled

    @classmethod
    def of(cls, model: PushModel, evidence: Evidence, z: Array) -> _Squares:
        """The squares of residuals z (n, 3), with the model's inputs regressed out."""
        controls = inputs_basis(model, evidence.table).columns
        residual = Residualizer(controls)(z)
        return cls(residual, evidence.table, Controlled.of(_bounded_squares(residual), controls, evidence.block))

    def columns(self, basis: DriverBasis, on: Array) -> Array:
        """Columns (n, 3, m) of a covariate's basis, for the variance of the outputs on (3,)."""
        return on[None, :, None] * basis.values(self.table.covariates, len(self.residual))[:, None, :]


def variance_effects(
    model: PushModel,
    evidence: Evidence,
    z: Array,
    alpha: float,
    seed: int = 0,
    *,
    names: Sequence[str] | None = None,
    baseline: Baseline | None = None,
) -> VarianceFinding:
    """Test the variance of residuals z (n, 3), without mean effects, against every covariate and against training.

    A difference from training is reported only if no covariate explains it.
    """
    first = _tested(model, evidence, z, alpha, seed, names, baseline)
    driven = tuple(s for s in first.found if s.covariate != CONSTANT)
    if len(driven) < 2:
        return replace(first, found=driven or first.found)
    levelled = z / _trend(evidence, z, driven[0])
    again = {s.covariate for s in _tested(model, evidence, levelled, alpha, seed, names, baseline).found}
    found = (driven[0], *(s for s in driven[1:] if s.covariate in again))
    return replace(first, found=found, rivals=tuple(s.covariate for s in driven[1:] if s.covariate not in again))


def _trend(evidence: Evidence, z: Array, effect: VarianceEffect) -> Array:
    """Relative standard deviation (n, 3) of the residuals by an effect; 1 in outputs that it does not concern."""
    values = effect.basis.values(evidence.table.covariates, len(z))
    on = _on(effect.outputs)
    size = _log_squares(z) @ on / on.sum()
    design = np.column_stack([np.ones(len(values)), values])
    slope, *_ = np.linalg.lstsq(design, size, rcond=None)
    fitted = design @ slope
    return np.asarray(np.exp(0.5 * (fitted - fitted.mean())[:, None] * on))


def _tested(
    model: PushModel,
    evidence: Evidence,
    z: Array,
    alpha: float,
    seed: int,
    names: Sequence[str] | None,
    baseline: Baseline | None,
) -> VarianceFinding:
    squares = _Squares.of(model, evidence, z)
    trials = [t for name, basis in screening_bases(evidence.table, names) for t in _along(squares, name, basis)]
    if baseline is not None:
        constant = _constant(model, evidence, z, baseline)
        there = len(constant[0][1].rows) - len(trials[0][1].rows) if trials else 0
        trials = [*((tried, score.padded(there)) for tried, score in trials), *constant]
    if not trials:
        return VarianceFinding()
    screened = screen([score for _, score in trials], seed)
    if baseline is None:
        return _finding(trials, screened, alpha)
    detectable = _detectable(screened.threshold(alpha), evidence, z, baseline)
    if baseline.inputs.learnt:
        screened = _against_training(model, trials, screened, alpha, squares, baseline, seed)
    return replace(_finding(trials, screened, alpha), detectable=detectable)


def _against_training(
    model: PushModel,
    trials: Sequence[Trial],
    screened: Screened,
    alpha: float,
    new: _Squares,
    baseline: Baseline,
    seed: int,
) -> Screened:
    """Raise p of what is found along covariates of training to that of the difference from training."""
    found = [k for k, (t, _) in enumerate(trials) if screened.p_value[k] <= alpha and t.basis.drivers]
    compared = [k for k in found if baseline.comparable(trials[k][0].basis)]
    if not compared:
        return screened
    before = _Squares.of(model, baseline.evidence, baseline.evidence.z)
    every = {k: (trials[k][0].basis, _on(trials[k][0].outputs)) for k in compared}
    changes = {
        k: difference(*(s.bounded.raw_scores(s.columns(*each)) for s in (new, before))) for k, each in every.items()
    }
    return raised(screened, changes, seed)


def _detectable(threshold: float, evidence: Evidence, z: Array, baseline: Baseline) -> float:
    """The ratio of standard deviations whose squares exceed the threshold with 80 % probability."""
    square = 0.0
    for residual, block in ((z, evidence.block), (baseline.evidence.z, baseline.evidence.block)):
        size = _bounded_squares(residual).mean(axis=1)
        of_block = sums_by(block, (size / size.mean() - 1.0)[:, None])[:, 0]
        square += float(np.sum(of_block**2)) / len(size) ** 2
    return max(NOTABLE, float(np.sqrt(1.0 + (threshold + QUANTILE) * np.sqrt(square))))


def _log_squares(residual: Array) -> Array:
    return np.asarray(np.log(residual**2 + TINY))


def _bounded_squares(residual: Array) -> Array:
    """Squares (n, 3) in units of each output's robust variance, at most MOST."""
    unit = MAD_TO_SD * np.median(np.abs(residual), axis=0)
    return np.asarray(np.minimum((residual / np.maximum(unit, TINY)) ** 2, MOST))


def _along(squares: _Squares, name: str, basis: DriverBasis) -> list[Trial]:
    """One covariate against the variance of each output, and of all outputs."""
    values = basis.values(squares.table.covariates, len(squares.residual))
    size = _log_squares(squares.residual)
    slope, *_ = np.linalg.lstsq(np.column_stack([np.ones(len(values)), values]), size, rcond=None)
    trend = np.exp(0.5 * np.ptp(values @ slope[1:], axis=0))
    trials = []
    for outputs in TRIED:
        on = _on(outputs)
        ratio = float(np.prod(trend ** (on / on.sum())))
        scores = squares.bounded.unit_scores(squares.columns(basis, on))
        trials.append((VarianceEffect(name, basis, outputs, 1.0, ratio), scores))
    return trials


def _constant(model: PushModel, evidence: Evidence, z: Array, baseline: Baseline) -> list[Trial]:
    """The variance in the new data against that in training, with the inputs regressed out."""
    tables = (evidence.table, baseline.evidence.table)
    controls = inputs_basis(model, _inputs_of(tables)).columns
    # Not residualised: errors of the base enter both parts alike, but regression would not remove them alike.
    parts = (_log_squares(z), _log_squares(baseline.evidence.z))
    new = np.arange(len(controls)) < len(z)
    block = np.concatenate([evidence.block, evidence.block.max() + 1 + baseline.evidence.block])
    squares = Controlled.of(_bounded_squares(np.vstack([z, baseline.evidence.z])), controls, block)
    ratio = np.exp(0.5 * (parts[0].mean(axis=0) - parts[1].mean(axis=0)))
    trials = []
    for outputs in TRIED:
        on = _on(outputs)
        strength = float(np.prod(ratio ** (on / on.sum())))
        tried = VarianceEffect(CONSTANT, DriverBasis("constant"), outputs, 1.0, strength)
        trials.append((tried, squares.unit_scores((on * new[:, None])[:, :, None])))
    return trials


def _inputs_of(tables: tuple[PushTable, PushTable]) -> PushTable:
    names = [np.char.add(prefix, t.push_id) for prefix, t in zip(("new ", "old "), tables, strict=True)]
    return PushTable(
        np.vstack([t.inputs for t in tables]),
        np.concatenate([t.duration for t in tables]),
        np.vstack([t.outcomes for t in tables]),
        np.concatenate(names),
    )


def _on(outputs: tuple[str, ...]) -> Array:
    """Which outputs (3,) an effect concerns."""
    return np.array([float(name in outputs) for name in OUTPUTS])


def _finding(trials: Sequence[Trial], screened: Screened, alpha: float) -> VarianceFinding:
    first: dict[str, VarianceEffect] = {}
    for k in sorted(range(len(trials)), key=lambda k: -screened.statistic[k]):
        tried = replace(trials[k][0], p_value=float(screened.p_value[k]))
        first.setdefault(tried.covariate, tried)
    notable = (s for s in first.values() if s.p_value <= alpha and abs(np.log(s.ratio)) > np.log(NOTABLE))
    return VarianceFinding(tuple(notable))

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The search on a recorded quantity: the gap at the contact, the force, the noise of the outcomes.

It is the search on the motion (selection/) with another response: a gate over all candidates, the one that gains most
on pushes to which it was not fitted, its rivals, and what is left. It is linear in its candidates: no fit is repeated.

The rows of training and new windows are stacked. A column that is nonzero on the new rows alone, with the same column
on all rows among the controls, has as its coefficient the new relation minus that in training.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.joint_fit import standard_error
from push_predictor.residuals.evidence.drivers import CONSTANT, OF_SESSION, between_ends, step_places
from push_predictor.residuals.evidence.residualizer import ResidualBlocks, Residualizer, sums_by
from push_predictor.residuals.evidence.standardised import FEWEST_PUSHES, blocks_of
from push_predictor.residuals.outcome import Sized, Tested, best_of, in_trace
from push_predictor.residuals.selection.naming import REJECTED, surely
from push_predictor.residuals.selection.screening import Columns, Screened, screen
from push_predictor.types import Array, BoolArray, IntArray

DRAWS = 1000
FOLDS = 5
GROSS = 5.0  # robust standard deviations; guards against gross errors: windows farther out are rejected
TRIMMING_ROUNDS = 4
MAD_TO_SD = 1.4826
COLLINEAR = 1e-6  # share of a column's square that the controls do not explain; less counts as collinear
MOST_NEAR = 12  # places of a step that are tried near the best of the first


@dataclass(frozen=True)
class ChannelEffect:
    """An effect on a recorded quantity, with its p value on its channel; rivals: what fits equally well.

    mechanism: None for the noise. parameters: of a measurement error, the slider's stream against the robot's; of
    surface_friction, the relative change of the force from the 5th to the 95th percentile of the covariate, or since
    training where it is constant; of the noise, the factor on it; of wrench_bias, what the force reads too much (N, N)
    along the world's axes. outputs: whose noise it is.
    """

    mechanism: str | None
    covariate: str
    basis: str
    parameters: tuple[Sized, ...]
    p_value: float
    rivals: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    @property
    def values(self) -> tuple[float, ...]:
        """The parameters' estimates, as measurement.correct takes them."""
        return tuple(parameter.value for parameter in self.parameters)


@dataclass(frozen=True)
class ChannelFinding:
    """Effects on a recorded quantity, strongest first, and all candidates tested.

    detectable: of the noise, the smallest factor since training that would have been found with 80 % probability.
    """

    effects: tuple[ChannelEffect, ...] = ()
    tested: tuple[Tested, ...] = ()
    detectable: float = float("nan")

    def family_wise(self, share: float) -> ChannelFinding:
        """The same with p values of the whole trace: at most alpha exactly if at most the channel's share of it."""
        effects = tuple(replace(effect, p_value=min(1.0, effect.p_value / share)) for effect in self.effects)
        return replace(self, effects=effects, tested=in_trace(self.tested, share))


NOTHING_FOUND = ChannelFinding()


@dataclass(frozen=True, eq=False)
class Stacked:
    """n rows of the tables, training windows first: which rows are new (n,), and the block of pushes of each (n,).

    level (n, m): what may differ between the tables without any covariate: 1 on the new windows; no column without
    training windows.
    """

    tables: tuple[PushTable, ...]
    new: BoolArray
    block: IntArray
    level: Array


@dataclass(frozen=True, eq=False)
class Contrast:
    """A candidate: values (n, p), zero on training rows; shared (n, m): on all rows; on (k,): which outputs change."""

    mechanism: str | None
    covariate: str
    basis: DriverBasis
    values: Array
    shared: Array
    on: Array

    @property
    def columns(self) -> Array:
        """The values in every output (n, k, p)."""
        return self.values[:, None, :] * self.on[None, :, None]

    @property
    def label(self) -> tuple[str | None, str]:
        """Mechanism and covariate, whatever the basis."""
        return self.mechanism, self.covariate

    def take(self, rows: BoolArray) -> Contrast:
        """The contrast on the given rows."""
        return replace(self, values=self.values[rows], shared=self.shared[rows])


@dataclass(frozen=True, eq=False)
class Quantity:
    """z (n, k) on the rows of a stack that are used, its controls (n, m), and what may have changed it."""

    z: Array
    controls: Array
    stack: Stacked
    tried: tuple[Contrast, ...]
    rows: BoolArray

    @classmethod
    def of(cls, z: Array, controls: Array, stack: Stacked, tried: Sequence[Contrast], rows: BoolArray) -> Quantity:
        """The quantity on some rows (n,) of the stack."""
        known = tuple(t.take(rows) for t in identifiable(tried, controls))
        return cls(z[rows], controls[rows], stack, known, rows)

    @property
    def block(self) -> IntArray:
        """Block of pushes (n,)."""
        return self.stack.block[self.rows]


@dataclass(frozen=True, eq=False)
class Chosen:
    """A contrast that was chosen, with its p value and the names of its rivals."""

    contrast: Contrast
    p_value: float
    rivals: tuple[str, ...]


def searched(quantity: Quantity, alpha: float, seed: int = 0) -> tuple[list[Chosen], tuple[Tested, ...], float]:
    """The changes of a quantity, strongest first, all that was tested, and the statistic that passes the gate.

    What is chosen is a control of what is sought next. A constant change counts only if no covariate explains it.
    alpha: probability of any change where there is none.
    """
    z, block, controls = quantity.z, quantity.block, quantity.controls
    level = quantity.stack.level[quantity.rows]
    remaining, chosen = list(quantity.tried), list[Chosen]()
    tested, threshold = tuple[Tested, ...](), float("nan")
    while remaining:
        screened = screen_contrasts(z, remaining, controls, block, seed)
        if not tested:
            tested = best_of([t.label for t in remaining], screened.p_value.tolist())
            threshold = screened.threshold(alpha)
        passed = {id(t): p for t, p in zip(remaining, screened.p_value.tolist(), strict=True) if p <= alpha}
        significant = [t for t in remaining if id(t) in passed]
        driven = [t for t in significant if t.covariate != CONSTANT]
        if not significant or (not driven and any(c.contrast.covariate != CONSTANT for c in chosen)):
            break
        base = np.column_stack([controls, level]) if driven else controls
        alike = best_and_rivals(z, driven or significant, base, block)
        same = [t for t in significant if t.label == alike[0].label]
        best = _in_best_form(quantity, alike[0], same, base)
        chosen.append(Chosen(best, min(passed[id(t)] for t in same), _names(best, alike)))
        controls = np.column_stack([controls, best.values, best.shared])
        remaining = identifiable([t for t in remaining if t.label != best.label], controls)
    return chosen, tested, threshold


def sizes(quantity: Quantity, chosen: Sequence[Chosen], seed: int = 0) -> list[tuple[Array, Array]]:
    """Coefficients (p,) and bootstrap draws (DRAWS, p) of each chosen contrast, estimated together."""
    if not chosen:
        return []
    contrasts = [each.contrast for each in chosen]
    columns = np.concatenate([t.columns for t in contrasts], axis=2)
    shared = np.column_stack([t.shared for t in contrasts])
    values, draws = estimate_with_draws(quantity.z, columns, quantity.controls, shared, quantity.block, seed)
    ends = np.cumsum([t.values.shape[1] for t in contrasts])[:-1]
    return list(zip(np.split(values, ends), np.split(draws, ends, axis=1), strict=True))


def change_of(each: Contrast, table: PushTable, values: Array, draws: Array) -> Array:
    """The change (1 + DRAWS,) of a quantity by a contrast of one output, as estimated and drawn.

    It is from one end of its covariate in the table to the other, where it has ends; else the middle 90 % of its range.
    """
    every = np.concatenate([values[None], draws])
    if each.covariate == CONSTANT:
        return every[:, 0]
    # A curve may begin and end at the same value.
    change = None if each.basis.name == "quadratic" else between_ends(each.basis, table)
    if change is not None:
        return np.asarray(every @ change)
    of_rows = every @ each.basis.values(table.covariates, len(table)).T
    return np.asarray(np.subtract(*np.quantile(of_rows, [0.95, 0.05], axis=1)))


def effects_of(
    chosen: Sequence[Chosen],
    quantity: Quantity,
    table: PushTable,
    name: str,
    factor: Callable[[Array], Array],
    seed: int,
) -> list[ChannelEffect]:
    """The effects of the chosen contrasts, each with one parameter; factor: of a change of the quantity."""
    effects = []
    for each, size in zip(chosen, sizes(quantity, chosen, seed), strict=True):
        best = each.contrast
        over = "since training" if best.covariate == CONSTANT else "over the range of its covariate"
        change = factor(change_of(best, table, *size))[:, None]
        parameters = sized([(f"{name} {over}", "1")], change[0], change[1:])
        effects.append(ChannelEffect(*best.label, best.basis.name, parameters, each.p_value, each.rivals))
    return effects


def sized(parameters: Sequence[tuple[str, str]], values: Array, draws: Array) -> tuple[Sized, ...]:
    """Parameters (name, unit) with estimates (p,) and the 95 % intervals of draws (d, p)."""
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    each = zip(parameters, values.tolist(), low.tolist(), high.tolist(), strict=True)
    return tuple(Sized(name, value, least, most, unit) for (name, unit), value, least, most in each)


# --- candidates ------------------------------------------------------------------------------------------------------


def stacked(windows: PushTable, baseline: PushTable | None, needed: tuple[str, ...] = ()) -> Stacked:
    """Training windows, then new windows; the former are dropped if they lack a needed covariate or are few."""
    usable = (
        baseline is not None
        and all(name in baseline.covariates for name in needed)
        and len(baseline.pushes) >= FEWEST_PUSHES
    )
    tables = (baseline, windows) if usable and baseline is not None else (windows,)
    blocks, begin = [], 0
    for table in tables:
        blocks.append(blocks_of(table) + begin)
        begin = int(blocks[-1].max()) + 1
    new = np.concatenate([np.full(len(table), table is windows) for table in tables])
    level = new[:, None].astype(np.float64)[:, : len(tables) - 1]
    return Stacked(tables, new, np.concatenate(blocks), level)


def along(stack: Stacked, mechanism: str | None, covariate: str, basis: DriverBasis, on: Array) -> Contrast:
    """A change of the outputs on (k,) along a covariate of the new windows; centred unless it is constant.

    Where training recorded the covariate, too, and it means the same there, the change since training.
    """
    table, new = stack.tables[-1], stack.new
    values = basis.values(table.covariates, len(table))
    shared = stack.level
    if covariate == CONSTANT:
        shared = shared[:, :0]
    else:
        values = values - values.mean(axis=0)
        recorded = all(name in t.covariates for t in stack.tables for name in basis.drivers)
        if recorded and len(stack.tables) > 1 and covariate not in OF_SESSION:
            in_both = [basis.values(t.covariates, len(t)) for t in stack.tables]
            shared = np.column_stack([shared, np.concatenate(in_both)])
    own = np.zeros((len(new), values.shape[1]))
    own[new] = values
    return Contrast(mechanism, covariate, basis, own, shared, on)


def identifiable(tried: Sequence[Contrast], controls: Array) -> list[Contrast]:
    """Those of which no column is collinear with the controls (n, m) and the shared columns."""
    kept = []
    for each, clear in _cleared(tried, controls):
        before, after = (np.sum(values**2, axis=0) for values in (each.values, clear(each.values)))
        if np.all(after > COLLINEAR * before) and np.all(before > 0.0):
            kept.append(each)
    return kept


def _cleared(tried: Sequence[Contrast], controls: Array) -> list[tuple[Contrast, Residualizer]]:
    """Each with what regresses the controls and its shared columns out; many share the same."""
    known: dict[bytes, Residualizer] = {}
    for each in tried:
        if (key := each.shared.tobytes()) not in known:
            known[key] = Residualizer(np.column_stack([controls, each.shared]))
    return [(each, known[each.shared.tobytes()]) for each in tried]


def _names(best: Contrast, alike: Sequence[Contrast]) -> tuple[str, ...]:
    """Rivals by covariate, or by mechanism where the covariate is the same."""
    names = (t.mechanism if t.covariate == best.covariate else t.covariate for t in alike if t.label != best.label)
    return tuple(dict.fromkeys(name for name in names if name is not None))


def _in_best_form(quantity: Quantity, best: Contrast, same: Sequence[Contrast], controls: Array) -> Contrast:
    """The simplest form within a standard error of the best, as in the search on the motion; same: of its label.

    A step is moved to where it gains most.
    """
    forms, steps = [t for t in same if np.array_equal(t.on, best.on)], list[Contrast]()
    values = quantity.stack.tables[-1].covariates.get(best.covariate, np.zeros(1))

    def stepped(places: Sequence[float]) -> list[Contrast]:
        bases = [DriverBasis("step", (best.covariate,), place=place) for place in places]
        every = (along(quantity.stack, *best.label, basis, best.on) for basis in bases)
        return identifiable([each.take(quantity.rows) for each in every], controls)

    if best.basis.name in ("linear", "quadratic"):
        steps = stepped(step_places(values))
    every = [(t, _gains(quantity.z, t, controls, quantity.block)) for t in (*forms, *steps)]
    most = max((gains for _, gains in every), key=np.sum)
    near = [(t, gains) for t, gains in every if (most - gains).sum() <= standard_error(most - gains)]
    found = min(near, key=lambda each: (each[0].values.shape[1], -each[1].sum()))[0]
    if found.basis.name != "step":
        return found
    moved = stepped(step_places_near(values, found.basis.place))
    return best_and_rivals(quantity.z, [found, *moved], controls, quantity.block)[0]


def step_places_near(values: Array, place: float, most: int = MOST_NEAR) -> list[float]:
    """Midpoints between neighbouring values, from the next place that was tried below to the next above."""
    ordered, tried = np.unique(values), step_places(values)
    low = max((other for other in tried if other < place), default=-np.inf)
    high = min((other for other in tried if other > place), default=np.inf)
    middle = 0.5 * (ordered[1:] + ordered[:-1])
    inside = middle[(middle > low) & (middle < high)]
    return [float(middle) for middle in inside[:: max(1, -(-len(inside) // most))]]


# --- regression ------------------------------------------------------------------------------------------------------


def inliers(z: Array, columns: Array, controls: Array) -> BoolArray:
    """Rows (n,) of z (n, k) within GROSS deviations of their fit by controls (n, m) and columns (n, k, p)."""
    keep = np.ones(len(z), dtype=np.bool_)
    for _ in range(TRIMMING_ROUNDS):
        residual = np.column_stack(
            [_residual(z[:, k], np.column_stack([controls, columns[:, k]]), keep) for k in range(z.shape[1])]
        )
        spread = MAD_TO_SD * np.median(np.abs(residual[keep]), axis=0)
        keep = np.all(np.abs(residual) <= GROSS * np.maximum(spread, np.finfo(float).tiny), axis=1)
    return keep


def screen_contrasts(z: Array, tried: Sequence[Contrast], controls: Array, block: IntArray, seed: int = 0) -> Screened:
    """Screen contrasts on z (n, k), with the controls and the columns shared with training regressed out."""
    blocks: dict[int, ResidualBlocks] = {}
    scores = []
    for each, clear in _cleared(tried, controls):
        if id(clear) not in blocks:
            blocks[id(clear)] = clear.blocks(z, block)
        columns = Columns(clear(each.columns))
        scores.append(columns.scores(blocks[id(clear)]).turned(columns.unit))
    return screen(scores, seed)


def best_and_rivals(z: Array, tried: Sequence[Contrast], controls: Array, block: IntArray) -> list[Contrast]:
    """The contrast with the largest cross-validated gain, then those that it does not reject."""
    gains = [_gains(z, each, controls, block) for each in tried]
    best, *others = np.argsort([-float(gain.sum()) for gain in gains], kind="stable").tolist()
    return [tried[best], *(tried[k] for k in others if not surely(gains[best] - gains[k], REJECTED))]


def estimate_with_draws(
    z: Array, columns: Array, controls: Array, shared: Array, block: IntArray, seed: int = 0
) -> tuple[Array, Array]:
    """Coefficients (p,) of columns (n, k, p) for z (n, k), and bootstrap draws (DRAWS, p) of them by block."""
    residualizer = Residualizer(np.column_stack([controls, shared]))
    residual, flat = residualizer(z), residualizer(columns)
    p = flat.shape[2]
    square = sums_by(block, np.einsum("nkp,nkq->npq", flat, flat).reshape(len(z), -1)).reshape(-1, p, p)
    score = sums_by(block, np.einsum("nkp,nk->np", flat, residual))
    blocks = len(score)
    weights = (
        np.random.default_rng(seed).multinomial(blocks, np.full(blocks, 1.0 / blocks), size=DRAWS).astype(np.float64)
    )
    draws = _solved(np.tensordot(weights, square, axes=1), weights @ score)
    return _solved(square.sum(axis=0)[None], score.sum(axis=0)[None])[0], draws


def robust_deviation(values: Array) -> float:
    """Robust standard deviation of values (n,), from the median absolute deviation."""
    return float(MAD_TO_SD * np.median(np.abs(values - np.median(values))))


def _gains(z: Array, each: Contrast, controls: Array, block: IntArray) -> Array:
    """Cross-validated gain (b,) in nats of each block."""
    residualizer = Residualizer(np.column_stack([controls, each.shared]))
    residual, flat = Residualizer(controls)(z), residualizer(each.columns)
    gains = np.zeros((len(z), 1))
    for fold in range(FOLDS):
        test = block % FOLDS == fold
        x = flat[~test].reshape(-1, flat.shape[2])
        after = residual - flat @ np.linalg.lstsq(x, residual[~test].ravel(), rcond=None)[0]
        before_log, after_log = (_log_density(r[test], np.mean(r[~test] ** 2, axis=0)) for r in (residual, after))
        gains[test, 0] = after_log - before_log
    return sums_by(block, gains)[:, 0]


def _log_density(residual: Array, variance: Array) -> Array:
    variance = np.maximum(variance, np.finfo(float).tiny)  # a quantity may follow the controls exactly
    return np.asarray(-0.5 * np.sum(np.log(variance) + residual**2 / variance, axis=1))


def _residual(z: Array, design: Array, rows: BoolArray) -> Array:
    coefficients = np.linalg.lstsq(design[rows], z[rows], rcond=None)[0]
    return np.asarray(z - design @ coefficients)


def _solved(square: Array, score: Array) -> Array:
    """Minimum-norm solutions (d, p) of d linear systems."""
    return np.asarray(np.einsum("dpq,dq->dp", np.linalg.pinv(square, rcond=1e-12, hermitian=True), score))

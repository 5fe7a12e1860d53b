# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pushes that would separate rivals: where their predictions differ most, as far as an operator can set them.

They are designed as the pushes that a model learns most from are (push_predictor.design), with other unknowns. The
first rival and each other one are a case of their own, in which the effect is a mixture of the two: its unknown is the
share of the other one. The pushes are chosen that most reduce what is not known of these shares.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.design.greedy import greedy
from push_predictor.design.information import Information
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.pushes import Push
from push_predictor.recordings.table import INPUTS, PushTable
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.selection.settable import continued, has_long_pushes, proposed, settings, travels_of
from push_predictor.types import Array, BoolArray, IntArray

PUSHES = 20
ROWS = 150  # windows whose inputs are tried; more would only take longer
APART = 0.25  # distance of inputs, each in units of its range, from which two pushes are different
HOPELESS = 1.0  # expected difference of the rivals' log densities, in standard errors: below it nothing is decided
LARGEST_FACTOR = 10.0  # of a rival's size; a rival that needs more does not resemble the first
UNKNOWN = 1e3  # standard deviation of a size before the pushes made, in units of what was fitted


@dataclass(frozen=True, eq=False)
class Experiment:
    """Proposed pushes by name of input and covariate, in the order in which to make them.

    inseparable: covariates of rivals that no PUSHES further pushes would separate from the first.
    """

    pushes: tuple[Mapping[str, float], ...] = ()
    inseparable: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Trials:
    """What could be pushed next: each row of `rows` (r,) at each setting, as c = s * r candidates, setting by setting.

    made (p, m, 2), tried (p, c, 3, 2): standardised shifts by the first rival and by each of p others, of the pushes
    made and of a candidate push.
    """

    drivers: tuple[str, ...]
    rows: IntArray
    settings: list[dict[str, Array]]
    made: Array
    tried: Array


def separating_pushes(
    evidence: Evidence, rivals: Sequence[Effect], training: PushTable, inside: BoolArray | None = None
) -> Experiment:
    """Pushes that would separate the first rival from each other one, within the range of the training inputs.

    The inputs of each push are in the evidence; its covariates are set, if they can be, where the rivals differ most.
    inside (n,): windows among the inputs of training, all if None. No pushes without rivals.
    """
    usable = _within(evidence.table, training) & (True if inside is None else inside)
    if len(rivals) < 2 or not usable.any():
        return Experiment()
    trials = _trials(evidence, usable, rivals)
    order, clear = _chosen(evidence, trials)
    known = [other for other, decided in zip(rivals[1:], clear, strict=True) if decided]
    hopeless = tuple(dict.fromkeys(o.covariate for o, decided in zip(rivals[1:], clear, strict=True) if not decided))
    if not known:
        return Experiment(inseparable=hopeless)
    if hopeless:  # nothing is set for them
        trials = _trials(evidence, usable, [rivals[0], *known])
        order, _ = _chosen(evidence, trials)
    return Experiment(_proposed(evidence.table, trials, order), hopeless)


def drivers_of(rivals: Sequence[Effect]) -> tuple[str, ...]:
    """The covariates that rivals depend on."""
    return tuple(dict.fromkeys(name for rival in rivals for name in rival.basis.drivers))


def _within(table: PushTable, training: PushTable) -> BoolArray:
    """Windows (n,) whose speed and angle lie in the range of the training inputs; the contact goes all around."""
    known, inputs = training.inputs[:, [0, 2]], table.inputs[:, [0, 2]]
    return np.asarray(np.all((inputs >= known.min(axis=0)) & (inputs <= known.max(axis=0)), axis=1))


def _sample(table: PushTable, usable: BoolArray, drivers: Sequence[str]) -> IntArray:
    """Up to ROWS of the usable windows, evenly over the session.

    Long pushes should take little time and keep the contact: fast ones are tried that turn the slider least.
    """
    rows = np.flatnonzero(usable)
    if has_long_pushes(drivers):
        rows = rows[table.inputs[rows, 0] >= np.median(table.inputs[rows, 0])]
        turn = np.abs(table.outcomes[rows, 2]) / (table.inputs[rows, 0] * table.duration[rows])
        rows = rows[turn <= np.median(turn)]
    return np.asarray(rows[np.linspace(0, len(rows) - 1, min(ROWS, len(rows))).astype(np.intp)])


def _trials(evidence: Evidence, usable: BoolArray, rivals: Sequence[Effect]) -> _Trials:
    """The candidates: for each other rival what can be set for it and the first, in the middle of the further pushes.

    Each counts as a push of as many equal windows as pushes have on average.
    """
    drivers = drivers_of(rivals)
    rows = _sample(evidence.table, usable, drivers)
    near = evidence.take(rows)
    later = continued(evidence.table, drivers, PUSHES)
    grown = {name: np.full(len(rows), values[PUSHES // 2]) for name, values in later.items()}
    pairs = [drivers_of([rivals[0], other]) for other in rivals[1:]]
    tried = [one | grown for pair in pairs for one in settings(evidence.table, near.table, pair)]
    rivals = [rivals[0], *(_as_large(near, rivals[0], other) for other in rivals[1:])]
    made = np.stack([_shift(near, near.table.covariates, rival) for rival in rivals])
    then = np.stack([np.concatenate([_shift(near, one, rival) for one in tried]) for rival in rivals])
    weight, windows = len(evidence.table) / len(rows), len(evidence.table) / len(evidence.table.pushes)
    made, then = np.sqrt(weight) * made.reshape(len(rivals), -1), np.sqrt(windows) * then
    compared = [[0, other] for other in range(1, len(rivals))]
    return _Trials(drivers, rows, tried, made[compared].transpose(0, 2, 1), then[compared].transpose(0, 2, 3, 1))


def _chosen(evidence: Evidence, trials: _Trials) -> tuple[IntArray, BoolArray]:
    """Candidates in order, and for each other rival (p,) whether they would decide between it and the first."""
    made, tried = (shifts[..., 0] - shifts[..., 1] for shifts in (trials.made, trials.tried))
    sd = 1.0 / np.sqrt(1.0 + np.sum(made**2, axis=1))  # of the shares, after the pushes made
    features = tried.transpose(1, 2, 0) * sd
    information = Information(_apart(features), _unit(len(features), features[0].size), np.diag(sd))
    inputs, many = evidence.table.inputs[trials.rows], len(trials.settings)

    def novelty(order: Sequence[int]) -> Array:
        return np.tile(_novelty(inputs, np.array(order, dtype=np.intp) % len(inputs)), many)

    order, _ = greedy(information, min(PUSHES, len(inputs)), factor=novelty)
    seen = trials.tried[:, order].reshape(len(sd), -1, 2)
    gain = [_precision(np.concatenate(both)) - _precision(both[0]) for both in zip(trials.made, seen, strict=True)]
    return order, np.array([0.5 * np.sqrt(max(one, 0.0)) >= HOPELESS for one in gain])


def _apart(features: Array) -> Array:
    """Features (c, 3 p, p) of candidates whose outcomes (c, 3, p) in each case have an unknown of its own."""
    c, k, p = features.shape
    return np.asarray((features[:, :, :, None] * np.eye(p)).transpose(0, 2, 1, 3).reshape(c, p * k, p))


def _unit(count: int, size: int) -> Array:
    return np.broadcast_to(np.eye(size), (count, size, size))


def _precision(shifts: Array) -> float:
    """1 / variance of the less certain of two sizes after pushes with shifts (m, 2), in units of those fitted."""
    covariance = np.linalg.inv(shifts.T @ shifts + np.eye(2) / UNKNOWN**2)
    return float(1.0 / covariance.diagonal().max())


def _as_large(near: Evidence, first: Effect, other: Effect) -> Effect:
    """The other rival at the size that explains most of the first: shifts are not quite proportional to sizes."""
    one, two = (_shift(near, near.table.covariates, rival) for rival in (first, other))
    size = float(np.sum(one * two) / max(float(np.sum(two**2)), np.finfo(float).tiny))
    if not 1.0 / LARGEST_FACTOR < size < LARGEST_FACTOR:
        return other
    return replace(other, coefficients=size * np.asarray(other.coefficients))


def _shift(evidence: Evidence, covariates: Mapping[str, Array], rival: Effect) -> Array:
    """Standardised shift of the outcome (n, 3) by a rival."""
    push = Push(evidence.table.inputs, evidence.table.duration, covariates)
    return np.asarray(np.einsum("nij,nj->ni", evidence.whitener, joint_shift(evidence.mechanics, [rival], push)))


def _proposed(session: PushTable, trials: _Trials, order: IntArray) -> tuple[Mapping[str, float], ...]:
    """The candidates in order, each with what to set."""
    drivers = trials.drivers
    later, travels = continued(session, drivers, PUSHES), travels_of(session, drivers, PUSHES)
    usual = float(travels_of(session, (), 1)[0])
    pushes: list[Mapping[str, float]] = []
    for k, (setting, row) in enumerate(zip(*np.divmod(order, len(trials.rows)), strict=True)):
        push = dict(zip(INPUTS, session.inputs[trials.rows[row]].tolist(), strict=True))
        push |= {"travel": float(travels[k])} if travels[k] > usual else {}
        now = {name: float(values[k]) for name, values in later.items() if name in drivers}
        pushes.append({**push, **proposed(trials.settings[setting], drivers, int(row)), **now})
    return tuple(pushes)


def _novelty(inputs: Array, taken: IntArray) -> Array:
    """How different inputs (n, 3) are from those taken: 0 for the same ones, 1 from a distance of APART."""
    if not len(taken):
        return np.ones(len(inputs))
    away = np.abs(inputs[:, None] - inputs[None, taken]) / [inputs[:, 0].max(), 1.0, np.pi / 2.0]
    away[:, :, 1] = np.minimum(away[:, :, 1], 1.0 - away[:, :, 1])  # the outline is closed
    nearest = np.sqrt(np.sum(away**2, axis=2)).min(axis=1)
    return np.asarray(np.minimum(nearest / APART, 1.0) ** 2)

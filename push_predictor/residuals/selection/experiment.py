"""Pushes that would separate rivals: where their predictions differ most, as far as an operator can set them.

The rivals are compared as in a design for discrimination between models (Atkinson and Fedorov 1975): a push is worth
the squared standardised difference of their predictions. What a rival could still make up by another size, with the
pushes at hand, does not count as evidence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.mechanisms import Push
from push_predictor.recordings.table import INPUTS, PushTable
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.selection.settable import continued, has_long_pushes, proposed, settings, travels_of
from push_predictor.types import Array, BoolArray, IntArray

PUSHES = 20
ROWS = 150  # windows whose inputs are tried; more would only take longer
APART = 0.25  # distance of inputs, each in units of its range, from which two pushes are different
HOPELESS = 1.0  # expected difference of the rivals' log densities, in standard errors: below it nothing is decided


@dataclass(frozen=True, eq=False)
class Experiment:
    """Proposed pushes by name of input and covariate, in the order in which to make them.

    inseparable: covariates of rivals that no PUSHES further pushes would separate from the first.
    """

    pushes: tuple[Mapping[str, float], ...] = ()
    inseparable: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two rivals at settings (s,) of rows (r,): the squared difference of their predictions (s, r).

    expected: how clearly the best PUSHES of these would decide, in standard errors.
    """

    drivers: tuple[str, ...]
    settings: list[dict[str, Array]]
    difference: Array
    expected: float


def separating_pushes(
    evidence: Evidence, rivals: Sequence[Effect], training: PushTable, inside: BoolArray | None = None
) -> Experiment:
    """Pushes that would separate the first rival from each other one, within the range of the training inputs.

    The inputs of each push are in the evidence; its covariates are set, as far as they can be, where the two rivals
    differ most. inside (n,): windows among the inputs of training, all if None. No pushes without rivals.
    """
    usable = _within(evidence.table, training) & (True if inside is None else inside)
    if len(rivals) < 2 or not usable.any():
        return Experiment()
    rows = _sample(evidence.table, usable, drivers_of(rivals))
    pairs = [_pair(evidence, rows, rivals[0], other) for other in rivals[1:]]
    hopeless = [other.covariate for other, pair in zip(rivals[1:], pairs, strict=True) if pair.expected < HOPELESS]
    known = [pair for pair in pairs if pair.expected >= HOPELESS]
    return Experiment(_proposed(evidence.table, rows, known) if known else (), tuple(dict.fromkeys(hopeless)))


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


def _pair(evidence: Evidence, rows: IntArray, first: Effect, other: Effect) -> _Pair:
    """The rivals at all settings of these rows."""
    session, near = evidence.table, evidence.take(rows)
    drivers = drivers_of([first, other])
    tried = settings(session, near.table, drivers, PUSHES)
    one, two = (np.stack([_shift(near, covariates, rival) for covariates in tried]) for rival in (first, other))
    difference = np.sum((one - two) ** 2, axis=2)
    best = np.unravel_index(np.argsort(-difference, axis=None)[:PUSHES], difference.shape)
    now = [_shift(near, near.table.covariates, rival) for rival in (first, other)]
    windows = len(session) / len(session.pushes)
    weights = (len(session) / len(rows), windows)
    expected = min(
        _expected(now[0], now[1], one[best], two[best], weights),
        _expected(now[1], now[0], two[best], one[best], weights),
    )
    return _Pair(drivers, tried, difference, expected)


def _expected(now: Array, false_now: Array, then: Array, false_then: Array, weights: tuple[float, float]) -> float:
    """Expected difference of two rivals' log densities by further pushes, in standard errors.

    Standardised shifts (n, 3) by the true rival and by the false one, at the pushes made and at the further ones, each
    row with a weight. The false rival may take any multiple of its size.
    """
    made, further = weights
    scale = made * _product(now, false_now) + further * _product(then, false_then)
    size = made * _product(false_now, false_now) + further * _product(false_then, false_then)
    factor = scale / max(size, np.finfo(float).tiny)
    alone = _product(now, false_now) / max(_product(false_now, false_now), np.finfo(float).tiny)
    after = made * _square(now - factor * false_now) + further * _square(then - factor * false_then)
    return 0.5 * float(np.sqrt(max(after - made * _square(now - alone * false_now), 0.0)))


def _product(one: Array, other: Array) -> float:
    return float(np.sum(one * other))


def _square(values: Array) -> float:
    return float(np.sum(values**2))


def _shift(evidence: Evidence, covariates: Mapping[str, Array], rival: Effect) -> Array:
    """Standardised shift of the outcome (n, 3) by a rival."""
    push = Push(evidence.table.inputs, evidence.table.duration, covariates)
    return np.asarray(np.einsum("nij,nj->ni", evidence.whitener, joint_shift(evidence.mechanics, [rival], push)))


def _proposed(session: PushTable, rows: IntArray, pairs: Sequence[_Pair]) -> tuple[Mapping[str, float], ...]:
    """The pushes of all pairs in turn, each with what to set."""
    drivers = tuple(dict.fromkeys(name for pair in pairs for name in pair.drivers))
    later, travels = continued(session, drivers, PUSHES), travels_of(session, drivers, PUSHES)
    usual = float(travels_of(session, (), 1)[0])
    inputs, taken = session.inputs[rows], np.zeros(0, dtype=np.intp)
    pushes: list[Mapping[str, float]] = []
    for k in range(min(PUSHES, len(rows))):
        pair, turn = pairs[k % len(pairs)], k // len(pairs)
        setting = _separating(pair)[turn % len(_separating(pair))]
        row = int(np.argmax(pair.difference[setting] * _novelty(inputs, taken)))
        taken = np.append(taken, row)
        push = dict(zip(INPUTS, inputs[row].tolist(), strict=True))
        push |= {"travel": float(travels[k])} if travels[k] > usual else {}
        now = {name: float(values[k]) for name, values in later.items() if name in drivers}
        pushes.append({**push, **proposed(pair.settings[setting], drivers, row), **now})
    return tuple(pushes)


def _separating(pair: _Pair) -> list[int]:
    """The settings at which the rivals differ at least half as much as at the best."""
    best = pair.difference.max(axis=1)
    return [int(k) for k in np.flatnonzero(best >= 0.5 * best.max())]


def _novelty(inputs: Array, taken: IntArray) -> Array:
    """How different inputs (n, 3) are from those taken: 0 for the same ones, 1 from a distance of APART."""
    if not len(taken):
        return np.ones(len(inputs))
    away = np.abs(inputs[:, None] - inputs[None, taken]) / [inputs[:, 0].max(), 1.0, np.pi / 2.0]
    away[:, :, 1] = np.minimum(away[:, :, 1], 1.0 - away[:, :, 1])  # the outline is closed
    nearest = np.sqrt(np.sum(away**2, axis=2)).min(axis=1)
    return np.asarray(np.minimum(nearest / APART, 1.0) ** 2)

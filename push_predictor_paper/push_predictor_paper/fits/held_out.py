# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Held-out windows of a split by push, with the predictions of every kind of model and their speeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.evaluation.estimate import Estimate, of_draws
from push_predictor.evaluation.push_scores import by_push
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.types import Array, IntArray
from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.fits.curves import curves
from push_predictor_paper.fits.fit import KINDS, split_of
from push_predictor_paper.plan import SPEEDS
from push_predictor_paper.study import Study

SAME_SPEED = 1.12  # ratio of speeds that a reader is told as one
FEWEST_PUSHES = 8  # at a speed, for an interval


@dataclass(frozen=True, eq=False)
class HeldOut:
    """n held-out windows of all folds, of models with `size` training windows.

    push_id (n,); speed (n,) m/s, the push's; group (n,), number of its speed among `speeds`; travel (n,) m of the
    pusher; observed (n, 3); predicted by kind (n, 3).
    """

    size: int
    push_id: np.ndarray
    speed: Array
    group: IntArray
    speeds: Array
    travel: Array
    observed: Array
    predicted: Mapping[str, Array]

    def at(self, group: int) -> HeldOut:
        """The windows of one speed."""
        return self.take(self.group == group)

    def take(self, rows: np.ndarray) -> HeldOut:
        """Some of the windows."""
        columns = {f: getattr(self, f)[rows] for f in ("push_id", "speed", "group", "travel", "observed")}
        return replace(self, **columns, predicted={kind: mean[rows] for kind, mean in self.predicted.items()})

    @property
    def pushes(self) -> int:
        """The number of pushes."""
        return len(np.unique(self.push_id))

    def levelled(self) -> HeldOut:
        """Outcomes and predictions standardised within each speed, so that every speed counts."""
        held = np.unique(self.group)
        rows = [self.observed[self.group == k] for k in held]
        at = np.searchsorted(held, self.group)
        mean = np.array([r.mean(axis=0) for r in rows])[at]
        sd = np.array([r.std(axis=0).clip(1e-30) for r in rows])[at]
        predicted = {kind: (values - mean) / sd for kind, values in self.predicted.items()}
        return replace(self, observed=(self.observed - mean) / sd, predicted=predicted)

    @property
    def speed_range(self) -> str:
        """The speeds of these pushes, for a reader."""
        low, high = 1e3 * self.speed.min(), 1e3 * self.speed.max()
        return f"{1e3 * np.median(self.speed):.0f} mm/s" if high < SAME_SPEED * low else f"{low:.0f} to {high:.0f} mm/s"

    def error(self, kind: str) -> Array:
        """Squared errors (n, 3)."""
        return np.asarray((self.observed - self.predicted[kind]) ** 2)


def held_out(study: Study, corpus: Corpus) -> HeldOut | None:
    """The windows of the reference pair's learning curves at the plan's size, or at the largest smaller one; else None.

    All kinds of model, fold by fold.
    """
    pushes, found = corpus.sets[corpus.reference], curves(study, corpus, [corpus.reference], KINDS)
    sizes = [n for n in found.sizes([corpus.reference], "gp", "push") if n <= study.plan.size]
    if not sizes:
        return None
    folds = {kind: found.cells[corpus.reference, kind, "push", sizes[-1]] for kind in KINDS}
    table = pushes.table.take(np.concatenate([split_of(pushes, score.fit).test for score in folds["gp"]]))
    speed = push_speeds(table.push_id, table.inputs[:, 0])
    group = speed_groups(table.push_id, speed)
    speeds = np.array([np.median(speed[group == k]) for k in range(int(group.max()) + 1)])
    predicted = {kind: np.concatenate([score.predicted for score in scores]) for kind, scores in folds.items()}
    travel = table.inputs[:, 0] * table.duration
    return HeldOut(sizes[-1], table.push_id, speed, group, speeds, travel, table.outcomes, predicted)


def push_speeds(push_id: np.ndarray, speed: Array) -> Array:
    """The median speed (n,) of each row's push."""
    _, push = np.unique(push_id, return_inverse=True)
    medians = np.array([np.median(speed[push == k]) for k in range(int(push.max()) + 1)])
    return np.asarray(medians[push])


def speed_groups(push_id: np.ndarray, speed: Array) -> IntArray:
    """Numbers (n,) of groups: the nearest of the paper's speeds, as a ratio; see `joined`."""
    return joined(np.abs(np.log(speed)[:, None] - np.log(SPEEDS)).argmin(axis=1), push_id)


def joined(group: IntArray, push_id: np.ndarray) -> IntArray:
    """Groups (n,) renumbered from 0, FEWEST_PUSHES in each: small ones join the next, the last its neighbour."""
    counts = [len(np.unique(push_id[group == k])) for k in range(int(group.max()) + 1)]
    numbers, number, held = [], 0, 0
    for count in counts:
        numbers.append(number)
        held += count
        if held >= FEWEST_PUSHES:
            number, held = number + 1, 0
    return np.minimum(np.array(numbers, dtype=np.int64), max(number - 1, 0))[group]


def within_nmse(windows: HeldOut, kinds: Sequence[str]) -> Estimate:
    """NMSE of a kind, or of the second kind minus the first, over the variance of these windows; interval by push."""

    def figure(sums: list[Array]) -> Array:
        first, second, total, squares, count = sums
        return np.asarray(((second - first) / (squares - total**2 / count)).sum(axis=1))

    errors = [windows.error(kind) for kind in kinds]
    first, second = errors if len(errors) == 2 else (np.zeros_like(errors[0]), errors[0])
    centred = windows.observed - windows.observed.mean(axis=0)
    columns = [first, second, centred, centred**2, np.ones((len(centred), 1))]
    return by_drawn_pushes(windows.push_id, columns, figure)


def bias(windows: HeldOut, kind: str, output: int) -> Estimate:
    """Mean of observed minus predicted as a share of the pusher's travel; interval by push.

    Across (output 1) it counts towards the side to which the slider goes by the analytical model, lest left and
    right cancel.
    """
    side = np.sign(windows.predicted["analytical"][:, 1]) if output == 1 else 1.0
    residual = side * (windows.observed[:, output] - windows.predicted[kind][:, output])
    columns = [residual[:, None], windows.travel[:, None]]
    return by_drawn_pushes(windows.push_id, columns, lambda sums: (sums[0] / sums[1])[:, 0])


def by_drawn_pushes(push_id: np.ndarray, columns: Sequence[Array], figure: Callable[[list[Array]], Array]) -> Estimate:
    """A figure of sums over windows of columns (n, k), with interval by push; none for too few pushes."""
    pushes, push = np.unique(push_id, return_inverse=True)
    sums = [by_push(push, column) for column in columns]
    value = float(figure([total.sum(axis=0, keepdims=True) for total in sums])[0])
    if len(pushes) < FEWEST_PUSHES:
        return Estimate(value, np.nan, np.nan)
    weights = push_bootstrap(pushes)
    return of_draws(value, figure([weights @ total for total in sums]))

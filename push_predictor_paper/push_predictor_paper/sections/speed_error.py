# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The models' error against the pusher's speed (paper, section VI-B: "for high velocities ... more unreliable")."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.stats import rankdata

from push_predictor.evaluation.estimate import Estimate, of_draws
from push_predictor.evaluation.push_scores import by_push
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.reporting.canvas import Picture
from push_predictor.types import Array, IntArray
from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.fits.curves import curves
from push_predictor_paper.fits.fit import KIND_NAMES, KINDS, SPLIT_WORDS, split_of
from push_predictor_paper.painters.curves import KIND_LOOKS, SPEED_TICKS, Line, Panel, paint_curves
from push_predictor_paper.plan import SPEEDS
from push_predictor_paper.section import Number, Section, Table, TooFewError, picture, speed_text
from push_predictor_paper.study import Study
from push_predictor_paper.verdict import Evidence, Figure

FAST = 0.1  # m/s, from which on a push counts as fast
SAME_SPEED = 1.12  # ratio of speeds that a reader is told as one
FEWEST_PUSHES = 8  # at a speed, for an interval
NO_DRAWS = np.zeros(0)
NOTES = (
    "The simulator has inertia, and friction that does not depend on speed. Quasi-static prediction therefore fails at "
    "high speed by construction. The speed at which it fails follows from the rig's masses and friction.",
    "Fast pushes have few windows each, and only those in which the tip stays in contact for the whole window.",
    "Slow pushes move the slider by 2 mm in a window. Friction noise and camera noise weigh more there.",
)
BySpeed = Mapping[str, Sequence[Estimate]]  # by kind of model, at each speed


@dataclass(frozen=True, eq=False)
class HeldOut:
    """n held-out windows of all folds, of models with `size` training windows.

    push_id (n,); speed (n,) m/s, the push's; group (n,), number of its speed among `speeds`; observed (n, 3); predicted
    by kind (n, 3).
    """

    size: int
    push_id: np.ndarray
    speed: Array
    group: IntArray
    speeds: Array
    observed: Array
    predicted: Mapping[str, Array]

    def at(self, group: int) -> HeldOut:
        """The windows of one speed."""
        return self.take(self.group == group)

    def take(self, rows: np.ndarray) -> HeldOut:
        """Some of the windows."""
        columns = {f: getattr(self, f)[rows] for f in ("push_id", "speed", "group", "observed")}
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


def section(study: Study, corpus: Corpus) -> Section:
    """NMSE within each speed, all kinds of model, whole pushes held out."""
    windows = held_out(study, corpus)
    if windows is None or len(windows.speeds) < 2:
        raise TooFewError(f"{corpus.name}: too few windows to train a model, or of one speed only.")
    by_speed = [windows.at(k) for k in range(len(windows.speeds))]
    nmse = {kind: [within_nmse(at, (kind,)) for at in by_speed] for kind in KINDS}
    evidence = {"unreliable": unreliable(windows), "captured": captured(windows)}
    return Section(evidence, (_table(corpus, windows, nmse),), (_picture(study, corpus, windows, nmse),), NOTES)


def unreliable(windows: HeldOut) -> Evidence:
    """Does the analytical model's error grow with speed? By rank correlation over pushes."""
    fast = windows.speeds[windows.group] >= 0.99 * FAST
    parts = {"all speeds": windows, f"from {speed_text(FAST)}": windows.take(fast)}
    figures = [Figure(name, rank_correlation(part, "analytical")) for name, part in parts.items()]
    return Evidence(figures, f"{windows.pushes} pushes, interval by push.")


def captured(windows: HeldOut) -> Evidence:
    """Do the learned models, whose input is the speed, lead at each speed from FAST on?"""
    fast = [k for k, speed in enumerate(windows.speeds) if speed >= 0.99 * FAST]
    figures = [Figure(speed_text(windows.speeds[k]), within_nmse(windows.at(k), ("analytical", "vhgp"))) for k in fast]
    return Evidence(figures, f"n = {windows.size}, {SPLIT_WORDS['push']}, interval by push.")


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
    return HeldOut(sizes[-1], table.push_id, speed, group, speeds, table.outcomes, predicted)


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


def rank_correlation(windows: HeldOut, kind: str) -> Estimate:
    """Spearman correlation over pushes of speed and mean squared error in units of the variance at that speed.

    NaN where the windows are of one speed.
    """
    if len(np.unique(windows.group)) < 2:
        return Estimate(np.nan, np.nan, np.nan)
    scaled = windows.levelled().error(kind).sum(axis=1)
    pushes, first, push = np.unique(windows.push_id, return_index=True, return_inverse=True)
    error, speed = np.bincount(push, scaled) / np.bincount(push), windows.speeds[windows.group[first]]
    once = np.ones((1, len(pushes)))
    return of_draws(float(spearman(error, speed, once)[0]), spearman(error, speed, push_bootstrap(pushes)))


def spearman(first: Array, second: Array, weights: Array) -> Array:
    """Rank correlations (d,) of samples in which each of n pairs occurs as often as its weight (d, n)."""
    samples = [np.repeat(np.arange(len(first)), drawn.astype(np.int64)) for drawn in weights]
    with np.errstate(invalid="ignore"):  # NaN in a draw of one speed
        return np.array([np.corrcoef(rankdata(first[rows]), rankdata(second[rows]))[0, 1] for rows in samples])


def within_nmse(windows: HeldOut, kinds: Sequence[str]) -> Estimate:
    """NMSE of a kind, or of the second kind minus the first, over the variance of these windows.

    Interval by push; none for too few pushes.
    """
    errors = [windows.error(kind) for kind in kinds]
    error = errors[0] if len(errors) == 1 else errors[1] - errors[0]
    centred = windows.observed - windows.observed.mean(axis=0)
    pushes, push = np.unique(windows.push_id, return_inverse=True)
    sums = [by_push(push, column) for column in (error, centred, centred**2, np.ones((len(centred), 1)))]

    def figure(weights: Array) -> Array:
        off, total, squares, count = (weights @ part for part in sums)
        return np.asarray((off / (squares - total**2 / count)).sum(axis=1))

    enough = len(pushes) >= FEWEST_PUSHES
    return of_draws(float(figure(np.ones((1, len(pushes))))[0]), figure(push_bootstrap(pushes)) if enough else NO_DRAWS)


def _table(corpus: Corpus, windows: HeldOut, nmse: BySpeed) -> Table:
    rows = []
    for k in range(len(windows.speeds)):
        at = windows.at(k)
        rows.append((at.speed_range, at.pushes, len(at.push_id), *(Number(of[k]) for of in nmse.values())))
    caption = (
        f"NMSE (sum of 3) over the variance at each speed. {corpus.reference_name}, n = {windows.size}, "
        f"{SPLIT_WORDS['push']}. Pushes: {corpus.name}; neighbouring speeds with fewer than {FEWEST_PUSHES} pushes are "
        "joined. Interval by push. The paper gives no numbers."
    )
    head = ("speed", "pushes", "windows", *(f"NMSE, {KIND_NAMES[kind]}" for kind in KINDS))
    return Table(caption, head, tuple(rows))


def _picture(study: Study, corpus: Corpus, windows: HeldOut, nmse: BySpeed) -> Picture:
    speeds = (1e3 * windows.speeds).tolist()
    ticks = [tick for tick in SPEED_TICKS if min(speeds) / 1.15 <= tick <= 1.15 * max(speeds)]
    lines = [Line(KIND_NAMES[kind], KIND_LOOKS[kind], speeds, nmse[kind]) for kind in KINDS]
    return picture(
        study.file("speed_error", corpus),
        (4.4, 3.4),
        partial(paint_curves, rows=[[Panel("", "speed (mm/s)", "NMSE, sum of 3", lines, ticks, ratio=True)]]),
        "Error of analytical model, GP and VHGP against the pusher's speed. NMSE within each speed. Bands: 95 % by "
        f"push. {corpus.reference_name}, pushes: {corpus.name}.",
    )

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The models' error against the pusher's speed (paper, section VI-B: "for high velocities ... more unreliable")."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from push_predictor.evaluation.estimate import Estimate, of_draws
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.reporting.canvas import Picture
from push_predictor.types import Array
from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.fits.fit import KIND_NAMES, KINDS, SPLIT_WORDS
from push_predictor_paper.fits.held_out import FEWEST_PUSHES, HeldOut, bias, held_out, within_nmse
from push_predictor_paper.painters.curves import KIND_LOOKS, SPEED_TICKS, Line, Panel, paint_curves
from push_predictor_paper.section import Number, Section, Table, TooFewError, picture, speed_text
from push_predictor_paper.study import Study
from push_predictor_paper.verdict import Evidence, Figure

FAST = 0.1  # m/s, from which on a push counts as fast
NOTES = (
    "The simulator has inertia, and friction that does not depend on speed. Quasi-static prediction therefore fails at "
    "high speed by construction. The speed at which it fails follows from the rig's masses and friction.",
    "Fast pushes have few windows each, and only those in which the tip stays in contact for the whole window.",
    "Slow pushes move the slider by 2 mm in a window. Friction noise and camera noise weigh more there.",
)


Curves = Mapping[str, Sequence[Estimate]]  # by kind of model, at each speed


def section(study: Study, corpus: Corpus) -> Section:
    """NMSE within each speed and bias along and across, all kinds of model, whole pushes held out."""
    windows = held_out(study, corpus)
    if windows is None or len(windows.speeds) < 2:
        raise TooFewError(f"{corpus.name}: too few windows to train a model, or of one speed only.")
    by_speed = [windows.at(k) for k in range(len(windows.speeds))]
    nmse = {kind: [within_nmse(at, (kind,)) for at in by_speed] for kind in KINDS}
    found = (nmse, _bias(by_speed, 0), _bias(by_speed, 1))
    evidence = {"unreliable": unreliable(windows), "captured": captured(windows)}
    return Section(evidence, (_table(corpus, windows, *found),), (_picture(study, corpus, windows, *found),), NOTES)


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
    one, other = (_centred(_ranks(values, weights), weights) for values in (first, second))
    with np.errstate(invalid="ignore"):  # NaN in a draw of one speed
        squares = np.sum(weights * one**2, axis=1) * np.sum(weights * other**2, axis=1)
        return np.asarray(np.sum(weights * one * other, axis=1) / np.sqrt(squares))


def _ranks(values: Array, weights: Array) -> Array:
    """Ranks (d, n), of equal values their mean."""
    order = np.argsort(values, kind="stable")
    _, place = np.unique(values, return_inverse=True)
    begins = np.flatnonzero(np.diff(values[order], prepend=np.nan))  # of each run of equal values
    counts = np.add.reduceat(weights[:, order], begins, axis=1)
    return np.asarray((np.cumsum(counts, axis=1) - 0.5 * (counts - 1.0))[:, place])


def _centred(ranks: Array, weights: Array) -> Array:
    return np.asarray(ranks - np.sum(weights * ranks, axis=1, keepdims=True) / weights.sum(axis=1, keepdims=True))


def _bias(windows: Sequence[HeldOut], output: int) -> Curves:
    """Bias at each speed, per cent of the pusher's travel."""
    return {kind: [bias(at, kind, output).times(100.0) for at in windows] for kind in KINDS}


def _table(corpus: Corpus, windows: HeldOut, nmse: Curves, along: Curves, across: Curves) -> Table:
    rows = []
    for k in range(len(windows.speeds)):
        at = windows.at(k)
        biases = (Number(part["analytical"][k], ".1f") for part in (along, across))
        rows.append((at.speed_range, at.pushes, len(at.push_id), *(Number(c[k]) for c in nmse.values()), *biases))
    caption = (
        f"NMSE (sum of 3) over the variance at each speed, and bias of the analytical model. "
        f"{corpus.reference_name}, n = {windows.size}, {SPLIT_WORDS['push']}. Pushes: {corpus.name}; "
        f"neighbouring speeds with fewer than {FEWEST_PUSHES} pushes are joined. Bias: mean of observed minus "
        "predicted, per cent of the pusher's travel; across: towards the predicted side. Interval by push. The paper "
        "gives no numbers."
    )
    head = ("speed", "pushes", "windows", *(f"NMSE, {KIND_NAMES[kind]}" for kind in KINDS), "bias along", "bias across")
    return Table(caption, head, tuple(rows))


def _picture(study: Study, corpus: Corpus, windows: HeldOut, nmse: Curves, along: Curves, across: Curves) -> Picture:
    speeds = (1e3 * windows.speeds).tolist()
    ticks = [tick for tick in SPEED_TICKS if min(speeds) / 1.15 <= tick <= 1.15 * max(speeds)]

    def panel(curves: Curves, title: str, label: str) -> Panel:
        lines = [Line(KIND_NAMES[kind], KIND_LOOKS[kind], speeds, curves[kind]) for kind in KINDS]
        return Panel(title, "speed (mm/s)", label, lines, ticks, ratio=curves is nmse, zero=curves is not nmse)

    share = "observed − predicted (% of travel)"
    panels = [
        panel(nmse, "NMSE within the speed", "NMSE, sum of 3"),
        panel(along, "bias along the push", share),
        panel(across, "bias across the push", share),
    ]
    return picture(
        study.file("speed_error", corpus),
        (8.4, 3.4),
        partial(paint_curves, rows=[panels], shared=False),
        "Error of analytical model, GP and VHGP against the pusher's speed. NMSE within each speed, and mean of "
        "observed minus predicted along and across the push, as a share of the pusher's travel. Bands: 95 % by push. "
        f"{corpus.reference_name}, pushes: {corpus.name}.",
    )

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The models' error against the pusher's speed (paper, section VI-B: "for high velocities ... more unreliable")."""

from __future__ import annotations

from typing import Any

import numpy as np

from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.reporting.canvas import Picture, draw
from push_predictor.types import Array
from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.estimate import Estimate, of_draws
from push_predictor_paper.figures.speed_error import SpeedCurve, paint_speed_error
from push_predictor_paper.fits.fit import KINDS, SPLIT_WORDS
from push_predictor_paper.fits.held_out import FEWEST_PUSHES, HeldOut, bias, held_out, within_nmse
from push_predictor_paper.section import Finding, Section, Table, Verdict, joined
from push_predictor_paper.study import Study

NAMES = {"analytical": "analytical", "gp": "GP", "vhgp": "VHGP"}
NOTABLE = 0.1  # a smaller rank correlation does not count as a dependence
FAST = 0.1  # m/s, from which on a push counts as fast
SIMULATOR = (
    "The simulator has inertia, and friction that does not depend on speed. Quasi-static prediction therefore fails at "
    "high speed by construction. The speed at which it fails follows from the rig's masses and friction.",
    "Fast pushes have few windows each, and only those in which the tip stays in contact for the whole window.",
    "Slow pushes move the slider by 2 mm in a window. Friction noise and camera noise weigh more there.",
)


def section(study: Study) -> Section:
    """NMSE within each speed and bias along and across, all kinds of model, whole pushes held out."""
    parts = [(corpus.title, _of_corpus(study, corpus, k)) for k, corpus in enumerate(study.corpora)]
    return joined("speed_error", "Error against speed", parts)


def _of_corpus(study: Study, corpus: Corpus, number: int) -> Section:
    windows = held_out(study, corpus)
    if windows is None:
        return Section("", "", (), notes=(f"{corpus.name}: too few windows to train a model.",))
    groups = list(range(len(windows.speeds)))
    if len(groups) < 2:
        note = f"{corpus.name}: one speed only ({_speed(windows.speeds[0])}), so the error cannot be compared by speed."
        return Section("", "", (), notes=(note,))
    found = {kind: _curve(windows, groups, kind) for kind in KINDS}
    findings = (unreliable(corpus, windows, found["analytical"]), captured(corpus, windows, groups))
    notes = SIMULATOR if corpus.origin == "simulated" else ()
    picture = _picture(study, corpus, windows, found, number)
    data = {kind: _curve_data(curve) for kind, curve in found.items()}
    return Section("", "", findings, (_table(corpus, windows, groups, found),), (picture,), notes, data)


def unreliable(corpus: Corpus, windows: HeldOut, curve: SpeedCurve) -> Finding:
    """Does the analytical model's error grow with speed? By rank correlation over pushes."""
    fast = windows.speeds[windows.group] >= 0.99 * FAST
    ranks = [rank_correlation(part, "analytical") for part in (windows, windows.take(fast))]
    sentence = (
        f"Spearman correlation of speed and squared error: {ranks[0].text()}; from {_speed(FAST)} on "
        f"{ranks[1].text()}. The error is in units of the variance at its speed; {windows.pushes} pushes, "
        f"{_set(corpus)}, interval by push. The NMSE within a speed goes from {curve.nmse[0].text()} at "
        f"{_speed(curve.speeds[0])} to {curve.nmse[-1].text()} at {_speed(curve.speeds[-1])}. Rule: holds if both "
        f"intervals lie above {NOTABLE}, in part if one does, does not hold if both end below {NOTABLE}."
    )
    claim = f"The analytical model is less reliable at high speed ({corpus.name})"
    return Finding(claim, _grows(ranks), sentence, number=f"rank correlation {ranks[0].text()}")


def captured(corpus: Corpus, windows: HeldOut, groups: list[int]) -> Finding:
    """Do the learned models, whose input is the speed, lead at each speed from FAST on?"""
    claim = f"Models with the speed as an input capture the dynamic effects ({corpus.name})"
    fast = [k for k in groups if windows.speeds[k] >= 0.99 * FAST]
    if not fast:
        return Finding(claim, "not decided", f"{corpus.name}: no pushes of {_speed(FAST)} or faster.")
    gaps = {k: within_nmse(windows.at(k), ("analytical", "vhgp")) for k in fast}
    listed = "; ".join(f"{_speed(windows.speeds[k])} {gap.text()}" for k, gap in gaps.items())
    sentence = (
        f"NMSE of the VHGP minus that of the analytical model within each speed: {listed}. n = {windows.size}, "
        f"{SPLIT_WORDS['push']}, {_set(corpus)}, interval by push. Rule: holds if the interval lies below 0 at all of "
        "these speeds, in part if at some, does not hold if it lies above 0 at some and below at none."
    )
    last = f"NMSE {gaps[fast[-1]].text('+.2f')} at {_speed(windows.speeds[fast[-1]])}"
    return Finding(claim, _ahead(list(gaps.values())), sentence, number=last)


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


def _grows(ranks: list[Estimate]) -> Verdict:
    grows = [rank.low > NOTABLE for rank in ranks]
    if all(grows):
        return "holds"
    if any(grows):
        return "holds in part"
    return "does not hold" if all(rank.high < NOTABLE for rank in ranks) else "not decided"


def _ahead(gaps: list[Estimate]) -> Verdict:
    below = [gap.high < 0.0 for gap in gaps]
    if all(below):
        return "holds"
    if any(below):
        return "holds in part"
    return "does not hold" if any(gap.low > 0.0 for gap in gaps) else "not decided"


def _curve(windows: HeldOut, groups: list[int], kind: str) -> SpeedCurve:
    at = [windows.at(k) for k in groups]
    return SpeedCurve(
        kind,
        tuple(float(windows.speeds[k]) for k in groups),
        tuple(within_nmse(w, (kind,)) for w in at),
        tuple(bias(w, kind, 0) for w in at),
        tuple(bias(w, kind, 1) for w in at),
    )


def _table(corpus: Corpus, windows: HeldOut, groups: list[int], found: dict[str, SpeedCurve]) -> Table:
    rows = []
    for i, k in enumerate(groups):
        at = windows.at(k)
        nmse = [found[kind].nmse[i].cell() for kind in KINDS]
        along, across = (_percent(e) for e in (found["analytical"].along[i], found["analytical"].across[i]))
        rows.append((at.speed_range, f"{at.pushes}", f"{len(at.push_id)}", *nmse, along, across))
    caption = (
        f"NMSE (sum of 3) over the variance at each speed, and bias of the analytical model. {corpus.reference[0]} on "
        f"{corpus.reference[1]}, n = {windows.size}, {SPLIT_WORDS['push']}. Pushes: {corpus.name}; neighbouring speeds "
        f"with fewer than {FEWEST_PUSHES} pushes are joined. Bias: mean of observed minus predicted, per cent of the "
        "pusher's travel; across: towards the predicted side. Interval by push. The paper gives no numbers."
    )
    head = ("speed", "pushes", "windows", *(f"NMSE, {NAMES[kind]}" for kind in KINDS), "bias along", "bias across")
    return Table(caption, head, tuple(rows))


def _picture(study: Study, corpus: Corpus, windows: HeldOut, found: dict[str, SpeedCurve], number: int) -> Picture:
    path = study.out / f"speed_error_{corpus.origin}_{number}.png"
    draw(path, (7.4, 3.2), lambda figure: paint_speed_error(figure, [found[kind] for kind in KINDS], NAMES))
    caption = (
        f"NMSE within each speed, and mean of observed minus predicted along and across the push, as a share of the "
        f"pusher's travel. {corpus.reference[0]} on {corpus.reference[1]}, {windows.pushes} pushes, n = "
        f"{windows.size}, {SPLIT_WORDS['push']}. Bands: 95 % by push. Pushes: {corpus.name}."
    )
    return Picture(path, "Error of analytical model, GP and VHGP against the pusher's speed", caption)


def _percent(share: Estimate) -> str:
    return Estimate(*(100.0 * v for v in (share.value, share.low, share.high))).cell(".1f")


def _speed(speed: float) -> str:
    return f"{1e3 * speed:.0f} mm/s"


def _set(corpus: Corpus) -> str:
    return f"{corpus.reference[0]} on {corpus.reference[1]}, {corpus.name}"


def _curve_data(curve: SpeedCurve) -> list[dict[str, Any]]:
    return [
        {"speed": speed, "nmse": nmse.json(), "bias_along": along.json(), "bias_across": across.json()}
        for speed, nmse, along, across in zip(curve.speeds, curve.nmse, curve.along, curve.across, strict=True)
    ]

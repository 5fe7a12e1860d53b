# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Verdicts of the comparison of analytical model, GP and VHGP, and their rules."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from push_predictor.evaluation.push_scores import PushScores
from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.estimate import (
    Estimate,
    difference_by_push,
    of_draws,
    total_exact_nlpd,
    total_nlpd,
    total_nmse,
)
from push_predictor_paper.fits.crossing import Crossing, crossing
from push_predictor_paper.fits.curves import Curves
from push_predictor_paper.fits.fit import SPLIT_WORDS, SPLITS, SplitName
from push_predictor_paper.section import Finding, Verdict

Crossings = Mapping[str, Crossing]  # by kind
PAPER_SIZE = 100  # training windows from about which both learned models lead in the paper
ABOUT = 150  # the largest size that still counts as about 100
SIMILAR = 0.10  # of the GP's NMSE
SI_TO_MM = float(2.0 * np.log(1000.0))  # NLPD of two lengths in mm less that in m
LEARNED = {"gp": "GP", "vhgp": "VHGP"}


def crossings_of(
    corpus: Corpus, found: Curves, sizes: Mapping[SplitName, tuple[int, ...]]
) -> Mapping[SplitName, Crossings]:
    """Training size from which GP and VHGP beat the analytical model, by split and kind."""

    def scores(kind: str, split: SplitName) -> list[list[PushScores]]:
        cells = [found.cells[corpus.reference, kind, split, n] for n in sizes[split]]
        return [[score.push_scores for score in cell] for cell in cells]

    return {
        split: {kind: crossing(sizes[split], scores(kind, split), scores("analytical", split)) for kind in LEARNED}
        for split in SPLITS
    }


def early(corpus: Corpus, where: Crossings) -> Finding:
    """Do both learned models beat the analytical one from about 100 windows?"""
    listed = "; ".join(f"{LEARNED[kind]} {at.text()}" for kind, at in where.items())
    sentence = (
        f"The NMSE stays below the analytical model's from this number of training windows on: {listed}. "
        f"{SPLIT_WORDS['push'].capitalize()}, {_set(corpus)}, interval by resampling pushes and folds. Rule: about "
        f"{PAPER_SIZE} means up to {ABOUT}. Holds if both intervals end by then, in part if one does, does not hold if "
        "both begin later."
    )
    claim = f"GP and VHGP beat the analytical model from about {PAPER_SIZE} samples ({corpus.name})"
    return Finding(claim, _in_time(where), sentence, number=f"windows: {listed}")


def in_the_end(corpus: Corpus, found: Curves, n: int) -> Finding:
    """Do both learned models have the smaller NMSE at the plan's size?"""
    gaps = {kind: _gap(corpus, found, "analytical", kind, n) for kind in LEARNED}
    listed = "; ".join(f"{LEARNED[kind]} {gap.text('.3f')}" for kind, gap in gaps.items())
    sentence = (
        f"NMSE minus that of the analytical model at n = {n}: {listed} (paper: −0.34; −0.35). "
        f"{_how(corpus, found, n)}. Rule: holds if both intervals lie below 0, in part if one does, does not hold if "
        "both lie above."
    )
    claim = f"The learned models predict better than the analytical one ({corpus.name})"
    return Finding(claim, _below(gaps), sentence, number=f"NMSE minus the analytical model's: {listed}")


def similar_mean(corpus: Corpus, found: Curves, n: int) -> Finding:
    """Do GP and VHGP have a similar NMSE?"""
    scores = [found.push_scores(corpus.reference, kind, "push", n) for kind in LEARNED]
    value = total_nmse(scores[1].totals())[0] / total_nmse(scores[0].totals())[0]
    ratio = of_draws(value, total_nmse(scores[1].resampled()) / total_nmse(scores[0].resampled()))
    sentence = (
        f"NMSE of the VHGP over that of the GP at n = {n}: {ratio.text()} (paper: 0.97). {_how(corpus, found, n)}. "
        f"Rule: similar means within {SIMILAR:.0%}. Holds if the interval lies within, in part if only the value does, "
        "does not hold if the interval lies outside."
    )
    claim = f"GP and VHGP have a similar NMSE ({corpus.name})"
    return Finding(claim, _alike(ratio), sentence, number=f"ratio {ratio.text()}")


def better_density(corpus: Corpus, found: Curves, n: int) -> Finding:
    """Does the VHGP have the smaller NLPD?"""
    gp, vhgp = (found.push_scores(corpus.reference, kind, "push", n) for kind in LEARNED)
    gaussian, exact = (difference_by_push(gp, vhgp, figure) for figure in (total_nlpd, total_exact_nlpd))
    sentence = (
        f"NLPD of the VHGP minus that of the GP at n = {n}: {gaussian.text()} nats; with its exact density "
        f"{exact.text()} (paper: −0.91). {_how(corpus, found, n)}. Rule: holds if the first interval lies below 0, in "
        "part if only that of the exact density does, does not hold if the first lies above."
    )
    claim = f"The VHGP beats the GP in NLPD ({corpus.name})"
    return Finding(claim, _denser(gaussian, exact), sentence, number=f"{gaussian.text()} nats")


def _gap(corpus: Corpus, found: Curves, first: str, second: str, n: int) -> Estimate:
    baseline, model = (found.push_scores(corpus.reference, kind, "push", n) for kind in (first, second))
    return difference_by_push(baseline, model, total_nmse)


def _how(corpus: Corpus, found: Curves, n: int) -> str:
    pushes = len(found.push_scores(corpus.reference, "gp", "push", n).windows)
    return f"{SPLIT_WORDS['push'].capitalize()}, {pushes} pushes, {_set(corpus)}, interval by push"


def _set(corpus: Corpus) -> str:
    return f"{corpus.reference[0]} on {corpus.reference[1]}, {corpus.name}"


def _in_time(where: Crossings) -> Verdict:
    reached = [at for at in where.values() if at.last >= ABOUT]
    in_time = [at for at in where.values() if at.high <= ABOUT]
    if len(in_time) == len(where):
        return "holds"
    if in_time:
        return "holds in part"
    late = len(reached) == len(where) and all(at.low > ABOUT for at in where.values())
    return "does not hold" if late else "not decided"


def _below(gaps: Mapping[str, Estimate]) -> Verdict:
    below = [gap.high < 0.0 for gap in gaps.values()]
    if all(below):
        return "holds"
    if any(below):
        return "holds in part"
    return "does not hold" if all(gap.low > 0.0 for gap in gaps.values()) else "not decided"


def _alike(ratio: Estimate) -> Verdict:
    low, high = 1.0 - SIMILAR, 1.0 + SIMILAR
    if low <= ratio.low and ratio.high <= high:
        return "holds"
    if ratio.low > high or ratio.high < low:
        return "does not hold"
    return "holds in part" if low <= ratio.value <= high else "not decided"


def _denser(gaussian: Estimate, exact: Estimate) -> Verdict:
    if gaussian.high < 0.0:
        return "holds"
    if exact.high < 0.0:
        return "holds in part"
    return "does not hold" if gaussian.low > 0.0 else "not decided"

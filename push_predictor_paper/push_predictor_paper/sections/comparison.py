# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Analytical model, GP and VHGP on the reference pair: scores, curves, crossing (paper, sections IV and VI-B)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from push_predictor.evaluation.estimate import (
    Estimate,
    by_push,
    difference_by_push,
    of_draws,
    total_exact_nlpd,
    total_nlpd,
    total_nmse,
)
from push_predictor.evaluation.estimate import Figure as Statistic
from push_predictor.evaluation.push_scores import PooledScores, PushScores
from push_predictor.recordings.table import OUTPUTS
from push_predictor.reporting.canvas import Picture
from push_predictor.types import Array
from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.fits.crossing import Crossing, crossing
from push_predictor_paper.fits.curves import Curves, curves
from push_predictor_paper.fits.fit import KIND_NAMES, KINDS, SPLIT_WORDS, SPLITS, SplitName
from push_predictor_paper.painters.curves import KIND_LOOKS, Line, Panel, paint_curves
from push_predictor_paper.section import Number, Section, Table, TooFewError, picture
from push_predictor_paper.study import Study
from push_predictor_paper.verdict import Evidence, Figure

LEARNED = KINDS[1:]
MEASURES = (("NMSE", "nmse", ".3f"), ("NLPD", "nlpd", ".2f"), ("exact NLPD", "exact_nlpd", ".2f"))
PAIRS_OF_KINDS = (("analytical", "gp"), ("analytical", "vhgp"), ("gp", "vhgp"))
SI_TO_MM = float(2.0 * np.log(1000.0))  # NLPD of two lengths in mm less that in m
PAPER = {"nmse": ("0.72", "0.38", "0.37"), "nlpd": ("–", "−2.82", "−3.73")}
NOTES = (
    "The simulator has rigid bodies, Coulomb friction and a slider whose outline the analytical model knows exactly. "
    "Except for inertia and noise it meets that model's assumptions, more than a real rig does. The size at which the "
    "learned models overtake it is therefore a property of the simulated rig and its speeds.",
)
Sizes = Mapping[SplitName, Sequence[int]]
Crossings = Mapping[SplitName, Mapping[str, Crossing]]  # by split and kind


def section(study: Study, corpus: Corpus) -> Section:
    """Compare the three kinds of model on the reference pair of a corpus."""
    found = curves(study, corpus, [corpus.reference], KINDS)
    sizes = {split: _common_sizes(found, corpus, split) for split in SPLITS}
    if not all(sizes.values()):
        raise TooFewError(f"{corpus.name}: too few windows to compare models.")
    last = {split: max([n for n in sizes[split] if n <= study.plan.size]) for split in SPLITS}
    where = crossings_of(corpus, found, sizes)
    learned = {n: [found.push_scores(corpus.reference, kind, "push", n) for kind in LEARNED] for n in sizes["push"]}
    gains = {n: difference_by_push(gp, vhgp, total_nmse) for n, (gp, vhgp) in learned.items()}
    tables = [_table(corpus, found, split, last[split]) for split in SPLITS]
    return Section(
        {**comparison_evidence(corpus, found, where["push"], last["push"]), "mean_gain": improves(gains)},
        (*tables, _paper_table(corpus, found, last["push"])),
        (_picture(study, corpus, found, sizes, where),),
        NOTES,
    )


def _common_sizes(found: Curves, corpus: Corpus, split: SplitName) -> list[int]:
    """Training sizes at which all three kinds were scored."""
    return sorted(set.intersection(*(set(found.sizes([corpus.reference], kind, split)) for kind in KINDS)))


def crossings_of(corpus: Corpus, found: Curves, sizes: Sizes) -> Crossings:
    """Training size from which GP and VHGP beat the analytical model, by split and kind."""

    def scores(kind: str, split: SplitName) -> list[list[PushScores]]:
        cells = [found.cells[corpus.reference, kind, split, n] for n in sizes[split]]
        return [[score.push_scores for score in cell] for cell in cells]

    return {
        split: {kind: crossing(sizes[split], scores(kind, split), scores("analytical", split)) for kind in LEARNED}
        for split in SPLITS
    }


def comparison_evidence(corpus: Corpus, found: Curves, where: Mapping[str, Crossing], n: int) -> dict[str, Evidence]:
    """Early: from which size the learned models lead; then error, similarity and density at n windows, by push."""
    analytical, gp, vhgp = (found.push_scores(corpus.reference, kind, "push", n) for kind in KINDS)
    names = [KIND_NAMES[kind] for kind in LEARNED]
    early = [Figure(KIND_NAMES[kind], at.estimate(), text=at.text()) for kind, at in where.items()]
    better = [difference_by_push(analytical, model, total_nmse) for model in (gp, vhgp)]
    value = total_nmse(vhgp.totals())[0] / total_nmse(gp.totals())[0]
    ratio = of_draws(value, total_nmse(vhgp.resampled()) / total_nmse(gp.resampled()))
    density = [difference_by_push(gp, vhgp, statistic) for statistic in (total_nlpd, total_exact_nlpd)]
    how = f"n = {n}, {SPLIT_WORDS['push']}, {len(gp.windows)} pushes, interval by push."
    return {
        "early": Evidence(early, f"{SPLIT_WORDS['push'].capitalize()}, interval by resampling pushes and folds."),
        "better": Evidence(list(map(Figure, names, better)), how),
        "similar": Evidence([Figure("", ratio)], how),
        "density": Evidence(list(map(Figure, ("Gaussian", "exact density"), density)), how),
    }


def improves(gains: Mapping[int, Estimate]) -> Evidence:
    """Does input-dependent noise improve the mean at the largest size? gains: NMSE of the VHGP minus that of the GP."""
    better = [str(n) for n, gain in gains.items() if gain.high < 0.0]
    worse = [str(n) for n, gain in gains.items() if gain.low > 0.0]
    note = (
        f"n = {max(gains)}, the largest size, {SPLIT_WORDS['push']}, interval by push. The whole interval is below 0 "
        f"at n = {', '.join(better) or 'none'}, above at {', '.join(worse) or 'none'} (of {len(gains)} sizes, not "
        "corrected for their number)."
    )
    return Evidence([Figure("", gains[max(gains)])], note)


def output_statistic(measure: str, output: int | None) -> Statistic:
    """The measure of one output, or its sum over the outputs."""

    def statistic(totals: PooledScores) -> Array:
        values: Array = getattr(totals, measure)
        return np.asarray(values.sum(axis=1) if output is None else values[:, output])

    return statistic


def _table(corpus: Corpus, found: Curves, split: SplitName, n: int) -> Table:
    scores = {kind: found.push_scores(corpus.reference, kind, split, n) for kind in KINDS}
    rows = []
    for label, measure, form in MEASURES:
        for output, name in ((None, "total"), *enumerate(OUTPUTS)):
            statistic = output_statistic(measure, output)
            values = [by_push(scores[kind], statistic) for kind in KINDS]
            gaps = [difference_by_push(scores[a], scores[b], statistic) for a, b in PAIRS_OF_KINDS]
            rows.append((f"{label}, {name}", *(Number(e, form) for e in (*values, *gaps))))
    caption = (
        f"Scores at n = {n}, {SPLIT_WORDS[split]}. {corpus.reference_name}, pushes: {corpus.name}, "
        f"{len(scores['gp'].windows)} scored. Intervals resample whole pushes; differences are paired. NLPD in SI "
        "units; for the analytical model, of a Gaussian with the covariance of its training residuals."
    )
    gaps_of = (f"{KIND_NAMES[b]} minus {KIND_NAMES[a]}" for a, b in PAIRS_OF_KINDS)
    return Table(caption, ("", *(KIND_NAMES[kind] for kind in KINDS), *gaps_of), tuple(rows))


def _paper_table(corpus: Corpus, found: Curves, n: int) -> Table:
    """The paper's table next to ours, in the paper's units."""
    scores = {kind: found.push_scores(corpus.reference, kind, "push", n) for kind in KINDS}
    rows = []
    for label, measure, shift in (("NMSE", "nmse", 0.0), ("NLPD (mm, rad)", "nlpd", SI_TO_MM)):
        ours = [by_push(scores[kind], output_statistic(measure, None)) for kind in KINDS]
        shifted = (Number(Estimate(e.value + shift, e.low + shift, e.high + shift)) for e in ours)
        rows.append((label, *PAPER[measure], *shifted))
    caption = (
        f"The paper's table next to ours: {corpus.name}, {corpus.reference_name}, n = {n}, {SPLIT_WORDS['push']}, "
        f"{len(scores['gp'].windows)} pushes, interval by push. The paper learns from the MIT push data set. It names "
        "neither test set, split, size nor units of its table. Its NLPD are in the range of mm and rad, so ours are in "
        "these units here (SI + 13.8155)."
    )
    head = ("", *(f"{KIND_NAMES[kind]}, {whose}" for whose in ("paper", "here") for kind in KINDS))
    return Table(caption, head, tuple(rows))


def _picture(study: Study, corpus: Corpus, found: Curves, sizes: Sizes, where: Crossings) -> Picture:
    ticks = sorted({n for of_split in sizes.values() for n in of_split})
    rows = []
    for split in SPLITS:
        marks = [(KIND_LOOKS[kind][0], where[split][kind]) for kind in LEARNED]
        row = []
        for label, measure, crossings in (("NMSE, sum of 3", "nmse", marks), ("NLPD, sum of 3 (SI)", "nlpd", [])):
            lines = [_line(corpus, found, kind, split, measure, sizes[split]) for kind in KINDS]
            nmse = measure == "nmse"
            row.append(
                Panel(SPLIT_WORDS[split], "training windows n", label, lines, ticks, ratio=nmse, crossings=crossings)
            )
        rows.append(row)
    return picture(
        study.file("comparison", corpus),
        (7.4, 6.4),
        partial(paint_curves, rows=rows),
        "NMSE and NLPD of analytical model, GP and VHGP over training size. Bands: 95 % intervals by push. Marks at "
        "the foot: size from which GP and VHGP beat the analytical model, with interval (pointing right: beyond the "
        f"last size). A triangle at the top marks a value beyond the axis. {corpus.reference_name}, pushes: "
        f"{corpus.name}.",
    )


def _line(corpus: Corpus, found: Curves, kind: str, split: SplitName, measure: str, sizes: Sequence[int]) -> Line:
    statistic = output_statistic(measure, None)
    points = [by_push(found.push_scores(corpus.reference, kind, split, n), statistic) for n in sizes]
    return Line(KIND_NAMES[kind], KIND_LOOKS[kind], sizes, points)

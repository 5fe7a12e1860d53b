# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Analytical model, GP and VHGP on the reference pair: scores, curves, crossing (paper, section VI-B)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from push_predictor.evaluation.push_scores import PooledScores
from push_predictor.recordings.table import OUTPUTS
from push_predictor.reporting.canvas import Picture, draw
from push_predictor.types import Array
from push_predictor_paper.claims.comparison.findings import (
    PAPER_SIZE,
    SI_TO_MM,
    Crossings,
    better_density,
    crossings_of,
    early,
    in_the_end,
    similar_mean,
)
from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.estimate import Estimate, Figure, by_push, difference_by_push, over_seeds
from push_predictor_paper.figures.curves import KIND_LOOKS, Line, Panel, paint_panels
from push_predictor_paper.fits.curves import Curves, curves, gathered, nlpd_of, nmse_of, seeds_tried
from push_predictor_paper.fits.fit import INFORMED, KINDS, SPLIT_WORDS, SPLITS, Fit, SplitName, scores
from push_predictor_paper.section import Section, Table, joined
from push_predictor_paper.study import Study

NAMES = {"analytical": "analytical", "gp": "GP", "vhgp": "VHGP"}
MEASURES = (("NMSE", "nmse", ".3f"), ("NLPD", "nlpd", ".2f"), ("exact NLPD", "exact_nlpd", ".2f"))
PAIRS_OF_KINDS = (("analytical", "gp"), ("analytical", "vhgp"), ("gp", "vhgp"))
PAPER = {"NMSE": ("0.72", "0.38", "0.37"), "NLPD": ("–", "−2.82", "−3.73")}
SIMULATOR = (
    "The simulator has rigid bodies, Coulomb friction and a slider whose outline the analytical model knows exactly. "
    "Except for inertia and noise it meets that model's assumptions, more than a real rig does. The size at which the "
    "learned models overtake it is therefore a property of the simulated rig and its speeds."
)


def section(study: Study) -> Section:
    """Compare the three kinds of model on the reference pair of every corpus."""
    parts = [(corpus.title, _of_corpus(study, corpus, k)) for k, corpus in enumerate(study.corpora)]
    return joined("comparison", "Analytical model, GP and VHGP", parts)


def common_sizes(found: Curves, corpus: Corpus, split: SplitName) -> tuple[int, ...]:
    """Training sizes at which all three kinds were scored."""
    held = [set(found.sizes([corpus.reference], kind, split)) for kind in KINDS]
    return tuple(sorted(set.intersection(*held)))


def _of_corpus(study: Study, corpus: Corpus, number: int) -> Section:
    found = curves(study, corpus, [corpus.reference], KINDS)
    sizes = {split: common_sizes(found, corpus, split) for split in SPLITS}
    if not all(sizes.values()):
        return Section("", "", (), notes=(f"{corpus.name}: too few windows to compare models.",))
    last = {split: max([n for n in sizes[split] if n <= study.plan.size]) for split in SPLITS}
    where = crossings_of(corpus, found, sizes)
    findings = (
        early(corpus, where["push"]),
        in_the_end(corpus, found, last["push"]),
        similar_mean(corpus, found, last["push"]),
        better_density(corpus, found, last["push"]),
    )
    shown = [
        (split, n) for split in SPLITS for n in sorted({last[split], PAPER_SIZE} & set(sizes[split]), reverse=True)
    ]
    tables = [_table(corpus, found, split, n) for split, n in shown]
    tables += [_paper_table(corpus, found, last["push"])]
    if study.plan.informed:
        tables += [informed_table(study, corpus, found, last["push"])]
    tables += [_crossing_table(corpus, where), _cost(corpus, found, sizes)]
    data = {"crossing": _crossing_data(where), "scores": _data(corpus, found, sizes)}
    pictures = (_picture(study, corpus, found, sizes, where, number),)
    return Section("", "", findings, tuple(tables), pictures, _notes(study, corpus, sizes), data)


def output_figure(measure: str, output: int | None) -> Figure:
    """The measure of one output, or its sum over the outputs."""

    def figure(totals: PooledScores) -> Array:
        values: Array = getattr(totals, measure)
        return np.asarray(values.sum(axis=1) if output is None else values[:, output])

    return figure


def _table(corpus: Corpus, found: Curves, split: SplitName, n: int) -> Table:
    scores = {kind: found.push_scores(corpus.reference, kind, split, n) for kind in KINDS}
    rows = []
    for label, measure, form in MEASURES:
        for output, name in ((None, "total"), *enumerate(OUTPUTS)):
            figure = output_figure(measure, output)
            cells = [by_push(scores[kind], figure).cell(form) for kind in KINDS]
            gaps = [difference_by_push(scores[a], scores[b], figure).cell(form) for a, b in PAIRS_OF_KINDS]
            rows.append((f"{label}, {name}", *cells, *gaps))
    caption = (
        f"Scores at n = {n}, {SPLIT_WORDS[split]}. {_pair(corpus)}, pushes: {corpus.name}, {len(scores['gp'].windows)} "
        "scored. Intervals resample whole pushes; differences are paired. NLPD in SI units; for the analytical model, "
        "of a Gaussian with the covariance of its training residuals."
    )
    head = ("", *(NAMES[kind] for kind in KINDS), *(f"{NAMES[b]} minus {NAMES[a]}" for a, b in PAIRS_OF_KINDS))
    return Table(caption, head, tuple(rows))


def _paper_table(corpus: Corpus, found: Curves, n: int) -> Table:
    """The paper's table next to ours, in the paper's units."""
    scores = {kind: found.push_scores(corpus.reference, kind, "push", n) for kind in KINDS}
    rows = []
    for label, measure, shift in (("NMSE", "nmse", 0.0), ("NLPD (mm, rad)", "nlpd", SI_TO_MM)):
        ours = [_shifted(by_push(scores[kind], output_figure(measure, None)), shift).cell() for kind in KINDS]
        rows.append((label, *PAPER[label[:4]], *ours))
    caption = (
        f"The paper's table next to ours: {corpus.name}, {_pair(corpus)}, n = {n}, {SPLIT_WORDS['push']}, "
        f"{len(scores['gp'].windows)} pushes, interval by push. The paper learns from the MIT push data set. It names "
        "neither test set, split, size nor units of its table. Its NLPD are in the range of mm and rad, so ours are in "
        "these units here (SI + 13.8155)."
    )
    head = ("", *(f"{NAMES[kind]}, paper" for kind in KINDS), *(f"{NAMES[kind]}, here" for kind in KINDS))
    return Table(caption, head, tuple(rows))


def informed_table(study: Study, corpus: Corpus, found: Curves, n: int) -> Table:
    """GP and VHGP with fitted mechanics as mean next to the paper's three models; whole pushes held out."""
    pair = corpus.reference
    seeds = range(seeds_tried(study.plan, "push", True))
    fits = [(pair, Fit(kind, n, "push", seed)) for kind in INFORMED.values() for seed in seeds]
    informed = gathered(fits, scores(study.work, corpus, fits))
    plain = {kind: found.push_scores(pair, kind, "push", n) for kind in KINDS}
    other = {kind: informed.push_scores(pair, name, "push", n) for kind, name in INFORMED.items()}
    rows = []
    for label, measure, form in MEASURES:
        figure = output_figure(measure, None)
        cells = [by_push(each, figure).cell(form) for each in (*plain.values(), *other.values())]
        gaps = [difference_by_push(plain[kind], other[kind], figure).cell(form) for kind in INFORMED]
        rows.append((label, *cells, *gaps))
    caption = (
        f"The paper's three models, and the two learned ones with our fitted mechanics as mean, at n = {n}, "
        f"{SPLIT_WORDS['push']}. {_pair(corpus)}, pushes: {corpus.name}. The mechanics are fitted to these n windows. "
        "Intervals resample whole pushes; differences are paired, informed minus plain. NLPD in SI units."
    )
    named = [f"informed {NAMES[kind]}" for kind in INFORMED]
    gained = [f"informed minus plain {NAMES[kind]}" for kind in INFORMED]
    return Table(caption, ("", *(NAMES[kind] for kind in KINDS), *named, *gained), tuple(rows))


def _shifted(estimate: Estimate, shift: float) -> Estimate:
    return Estimate(*(v + shift for v in (estimate.value, estimate.low, estimate.high)))


def _crossing_table(corpus: Corpus, where: Mapping[SplitName, Crossings]) -> Table:
    rows = tuple((NAMES[kind], *(where[split][kind].cell() for split in SPLITS)) for kind in KINDS[1:])
    caption = (
        f"Training windows from which the total NMSE stays below the analytical model's, linear in log n. Interval by "
        f"resampling pushes and seeds. Pushes: {corpus.name}, {_pair(corpus)}. The paper: about 100."
    )
    return Table(caption, ("", *(SPLIT_WORDS[split] for split in SPLITS)), rows)


def _cost(corpus: Corpus, found: Curves, sizes: Mapping[SplitName, tuple[int, ...]]) -> Table:
    rows = []
    for n in sizes["push"]:
        cpu = [np.array([s.cpu for s in found.cells[corpus.reference, kind, "push", n]]) for kind in KINDS]
        ratio = np.median(cpu[2]) / max(np.median(cpu[1]), 1e-9)
        rows.append((str(n), *(_median_and_range(seconds) for seconds in cpu), f"{ratio:.1f}"))
    caption = (
        f"CPU time to train one model of three outputs, s: median over folds, beneath it the range. Pushes: "
        f"{corpus.name}. Other fits ran at the same time. The VHGP starts from a GP, whose fit is included."
    )
    return Table(caption, ("n", *(NAMES[kind] for kind in KINDS), "VHGP / GP"), tuple(rows))


def _median_and_range(seconds: Array) -> str:
    return f"{np.median(seconds):.3g}\n{seconds.min():.3g} to {seconds.max():.3g}"


def _picture(
    study: Study,
    corpus: Corpus,
    found: Curves,
    sizes: Mapping[SplitName, tuple[int, ...]],
    where: Mapping[SplitName, Crossings],
    number: int,
) -> Picture:
    rows = []
    for split in SPLITS:
        marks = tuple((KIND_LOOKS[kind][0], where[split][kind]) for kind in KINDS[1:])
        nmse = Panel(
            SPLIT_WORDS[split], "NMSE, sum of 3", _lines(corpus, found, split, "nmse", sizes), True, crossings=marks
        )
        nlpd = Panel(SPLIT_WORDS[split], "NLPD, sum of 3 (SI)", _lines(corpus, found, split, "nlpd", sizes))
        rows.append((nmse, nlpd))
    path = study.out / f"comparison_{corpus.origin}_{number}.png"
    draw(path, (7.4, 6.4), lambda figure: paint_panels(figure, rows))
    caption = (
        f"Three models by training size, {_pair(corpus)}. Above: whole pushes held out; below: random split. Bands: "
        "95 % intervals by push. Marks at the foot: size from which GP and VHGP beat the analytical model, with "
        "interval (pointing right: beyond the last size). A triangle at the top marks a value beyond the axis. "
        f"Pushes: {corpus.name}."
    )
    return Picture(path, "NMSE and NLPD of analytical model, GP and VHGP over training size", caption)


def _lines(
    corpus: Corpus, found: Curves, split: SplitName, measure: str, sizes: Mapping[SplitName, tuple[int, ...]]
) -> tuple[Line, ...]:
    figure = output_figure(measure, None)
    return tuple(
        Line(
            NAMES[kind],
            KIND_LOOKS[kind],
            sizes[split],
            tuple(by_push(found.push_scores(corpus.reference, kind, split, n), figure) for n in sizes[split]),
        )
        for kind in KINDS
    )


def _pair(corpus: Corpus) -> str:
    return f"{corpus.reference[0]} on {corpus.reference[1]}"


def _notes(study: Study, corpus: Corpus, sizes: Mapping[SplitName, tuple[int, ...]]) -> tuple[str, ...]:
    planned = {*study.plan.sizes, *((study.plan.largest,) if study.plan.largest else ())}
    notes = [
        f"{corpus.name}, {SPLIT_WORDS[split]}: n = {', '.join(map(str, missing))} exceeds the windows of "
        f"{_pair(corpus)}."
        for split in SPLITS
        if (missing := sorted(planned - set(sizes[split])))
    ]
    return (*notes, SIMULATOR) if corpus.origin == "simulated" else tuple(notes)


def _crossing_data(where: Mapping[SplitName, Crossings]) -> dict[str, Any]:
    return {split: {kind: at.json() for kind, at in kinds.items()} for split, kinds in where.items()}


def _data(corpus: Corpus, found: Curves, sizes: Mapping[SplitName, tuple[int, ...]]) -> list[dict[str, Any]]:
    rows = []
    for split in SPLITS:
        for n in sizes[split]:
            for kind in KINDS:
                push_scores = found.push_scores(corpus.reference, kind, split, n)
                measures = {m: by_push(push_scores, output_figure(m, None)).json() for _, m, _ in MEASURES}
                seeds = {
                    m: over_seeds([f(s) for s in found.cells[corpus.reference, kind, split, n]]).json()
                    for m, f in (("nmse_by_seed", nmse_of), ("nlpd_by_seed", nlpd_of))
                }
                rows.append({"split": split, "n": n, "kind": kind, **measures, **seeds})
    return rows

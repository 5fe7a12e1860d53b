# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Beyond the paper: are the predicted intervals and distributions calibrated?"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from push_predictor.evaluation.metrics import COVERAGE_LEVELS
from push_predictor.evaluation.push_scores import PooledScores
from push_predictor.recordings.table import OUTPUTS
from push_predictor.reporting.canvas import Picture, draw
from push_predictor.types import Array
from push_predictor_paper.claims.calibration.calibrated import MODELS, Calibrated, calibrated
from push_predictor_paper.claims.calibration.coverage_by_speed import (
    GroupCoverage,
    coverage_by_speed,
    speed_finding,
    speed_table,
)
from push_predictor_paper.claims.calibration.findings import calibration_findings
from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.estimate import by_push, total_exact_nlpd, total_nlpd
from push_predictor_paper.figures.pit import paint_by_speed, paint_pits
from push_predictor_paper.fits.fit import SPLIT_WORDS, SPLITS
from push_predictor_paper.section import Section, Table
from push_predictor_paper.statistics.pit import BARS, Histogram
from push_predictor_paper.study import Study


def section(study: Study) -> Section:
    """Coverage and PIT of every model, exact and Gaussian density of the VHGP, coverage by speed."""
    parts = [_part(study, number, corpus) for number, corpus in enumerate(study.corpora)]
    return Section(
        key="calibration",
        title="Calibration of the predicted distributions",
        findings=tuple(finding for part in parts for finding in part.findings),
        tables=tuple(table for part in parts for table in part.tables),
        pictures=tuple(picture for part in parts for picture in part.pictures),
        notes=(*NOTES, *(note for part in parts for note in part.notes)),
        data={part.title: dict(part.data) for part in parts},
    )


NOTES = (
    "The paper shows no calibration. Its densities are moment-matched Gaussians.",
    "The VHGP's exact predictive density is a Gaussian whose variance is log-normal. It has heavier tails; "
    "Gauss-Hermite quadrature integrates it.",
    "Intervals resample whole test pushes. They do not include the effect of other training windows.",
    "On the random split, training windows and test windows may come from the same push. All seeds share the test "
    "windows, and each seed counts them once.",
    "The noise of simulated pushes follows from the simulator's friction and pressure. Calibration on them shows that "
    "the method works, not that real noise has that shape.",
)


def _part(study: Study, number: int, corpus: Corpus) -> Section:
    """The part of one corpus; its title is the key in the JSON."""
    found, title = calibrated(study, corpus), f"{number}: {corpus.title}"
    if found is None:
        note = f"{corpus.name}: the reference set has too few windows for any size of the plan; no calibration."
        return Section("", title, (), notes=(note,))
    groups: tuple[GroupCoverage, ...] = ()
    if corpus.origin == "simulated":
        groups = coverage_by_speed(study.plan.speeds, found.judged["gp", "push"], found.judged["vhgp", "push"])
    return Section(
        "",
        title,
        findings=(*calibration_findings(found), *([speed_finding(groups)] if groups else [])),
        tables=(
            _coverage_table(found),
            _shape_table(found),
            _density_table(found),
            *([speed_table(groups, found.size)] if groups else []),
        ),
        pictures=(_pit_picture(study, number, found), *([_speed_picture(study, found, groups)] if groups else [])),
        data=_data(found, groups),
    )


def _coverage_table(found: Calibrated) -> Table:
    rows = tuple(
        (f"{model}, {split}", *(e.cell(".3f") for level in found.coverages[model, split] for e in level))
        for model in MODELS
        for split in SPLITS
    )
    return Table(
        f"Coverage of the central predicted intervals. {_what(found)} 95 % intervals by push.",
        ("model, split", *(f"{level:.0%}: {name}" for level in COVERAGE_LEVELS for name in OUTPUTS)),
        rows,
    )


def _shape_table(found: Calibrated) -> Table:
    def cells(shape: Histogram) -> list[str]:
        return [f"{m:.1%}\np = {p:.3f}" for m, p in zip(shape.misplaced, shape.p, strict=True)]

    return Table(
        f"Share of windows in the wrong one of {BARS} bars of the PIT histogram. Beneath, p: the probability of that "
        f"much or more if the true histogram is flat and pushes are resampled. {_what(found)}",
        ("model, split", *OUTPUTS),
        tuple((f"{m}, {s}", *cells(found.shapes[m, s])) for m in MODELS for s in SPLITS),
    )


def _density_table(found: Calibrated) -> Table:
    rows = []
    for split in SPLITS:
        push_scores = found.judged["vhgp", split].push_scores
        single = [by_push(push_scores, partial(_gain_of, k)) for k in range(len(OUTPUTS))]
        columns = [by_push(push_scores, total_nlpd), by_push(push_scores, total_exact_nlpd), found.gains[split]]
        rows.append((split, *(e.cell("+.3f") for e in (*columns, *single))))
    return Table(
        f"NLPD of the VHGP (nats, SI units): moment-matched Gaussian, exact predictive density, and their paired "
        f"difference, exact minus Gaussian. Below zero the exact density is better. {_what(found)} 95 % intervals by "
        "push.",
        ("split", "Gaussian", "exact", "difference", *(f"difference {name}" for name in OUTPUTS)),
        tuple(rows),
    )


def _gain_of(output: int, totals: PooledScores) -> Array:
    return np.asarray(totals.exact_nlpd[:, output] - totals.nlpd[:, output])


def _what(found: Calibrated) -> str:
    """The end of every caption: set, size, splits, number of windows."""
    splits = "; ".join(f"{s}: {SPLIT_WORDS[s]}, {found.windows(s)}" for s in SPLITS)
    where = " on ".join(found.corpus.reference)
    return f"Pushes: {found.corpus.name}; reference set {where}, {found.size} training windows. {splits}."


def _pit_picture(study: Study, number: int, found: Calibrated) -> Picture:
    shown = {model: (found.shapes[model, "push"], found.shapes[model, "random"]) for model in MODELS}
    path = draw(study.out / f"calibration_{number}.png", (9.0, 9.4), lambda figure: paint_pits(figure, shown))
    return Picture(
        path,
        f"PIT histograms of four predictive distributions, three outputs each ({found.name})",
        f"PIT histograms: where outcomes fall in the predicted distribution. Dashed: flat, a perfect forecast. A hump "
        "means that the intervals are too wide; a trough, that they are too narrow; a slope, that the mean is biased. "
        f"Whiskers: 95 % by push. A number at the top is the height of a bar that is cut off. {_what(found)}",
    )


def _speed_picture(study: Study, found: Calibrated, groups: tuple[GroupCoverage, ...]) -> Picture:
    models = {model: [group.models[model] for group in groups] for model in groups[0].models}
    names = [f"{group.name}\n{group.span.removesuffix(' mm/s')}" for group in groups]
    path = draw(study.out / "coverage_by_speed.png", (9.0, 3.6), lambda figure: paint_by_speed(figure, names, models))
    counts = ", ".join(f"{group.windows} {group.name} windows of {group.pushes} pushes" for group in groups)
    return Picture(
        path,
        "Coverage of the 95 % intervals of slow, medium and fast pushes, GP and VHGP",
        "Coverage of the 95 % intervals by speed. The GP has one noise level, the VHGP's noise depends on the input. "
        f"Simulated reference set, {found.size} training windows, {SPLIT_WORDS['push']}; {counts}. "
        "Whiskers: 95 % by push.",
    )


def _data(found: Calibrated, groups: tuple[GroupCoverage, ...]) -> dict[str, Any]:
    levels = [str(level) for level in COVERAGE_LEVELS]
    return {
        "n": found.size,
        "reference": list(found.corpus.reference),
        "coverage": {
            f"{model}, {split}": {
                level: {name: e.json() for name, e in zip(OUTPUTS, estimates, strict=True)}
                for level, estimates in zip(levels, found.coverages[model, split], strict=True)
            }
            for model in MODELS
            for split in SPLITS
        },
        "pit": {f"{m}, {s}": _shape_json(found.shapes[m, s]) for m in MODELS for s in SPLITS},
        "exact_less_gaussian_nlpd": {split: gain.json() for split, gain in found.gains.items()},
        "by_speed": [
            {"span": g.span, "windows": g.windows, "pushes": g.pushes}
            | {m: {n: e.json() for n, e in zip(OUTPUTS, es, strict=True)} for m, es in g.models.items()}
            for g in groups
        ],
    }


def _shape_json(shape: Histogram) -> dict[str, Any]:
    known = np.isfinite(shape.p)
    p = [float(v) if k else None for v, k in zip(shape.p, known, strict=True)]
    return {"shares": shape.shares.T.tolist(), "misplaced": shape.misplaced.tolist(), "p": p}

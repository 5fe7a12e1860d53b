# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""NMSE and NLPD against training size, per surface and per shape (paper, section VI-A, figures 7 and 8)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from push_predictor.reporting.canvas import Picture, draw
from push_predictor_paper.claims.learning.findings import (
    KIND,
    MEASURES,
    circle,
    pushes_of,
    saturation,
    surface,
    word,
)
from push_predictor_paper.data.corpus import Corpus, Pair
from push_predictor_paper.estimate import Estimate, over_seeds
from push_predictor_paper.figures.curves import Line, Panel, look_of, paint_panels
from push_predictor_paper.fits.curves import Curves, Measure, curves, sizes_tried
from push_predictor_paper.fits.fit import SPLIT_WORDS, SPLITS, SplitName
from push_predictor_paper.section import Section, Table, joined
from push_predictor_paper.study import Study

FEWEST_FOR_BAND = 3  # folds
AXES = (("surface", 1), ("shape", 0))  # what a figure compares, and its place in a pair


NOT_INCLUDED = (
    "Folds share training windows, and all draws of the random split share one test set. The intervals do not include "
    "the effect of another recording or other test windows."
)
AXIS_NAMES = {"NMSE": "NMSE, sum of 3", "NLPD": "NLPD, sum of 3 (SI)"}
SIMULATOR = (
    "The simulated surfaces differ in the level of their friction, in its variation over the table, and in the fit of "
    "slider and table (push_predictor/simulation/surface.py). A slow push does not depend on the level; the variation "
    "is representative, not measured. How much the surface matters here is an assumption and shows nothing about real "
    "materials. As on the rig, the contact point of a circle is redundant up to uneven pressure."
)


def section(study: Study) -> Section:
    """Learning curves of the VHGP on every pair of shape and surface of every corpus."""
    parts = [(corpus.title, _of_corpus(study, corpus, k)) for k, corpus in enumerate(study.corpora)]
    return joined("learning_curves", "Learning curves: surfaces and shapes", parts)


def _of_corpus(study: Study, corpus: Corpus, number: int) -> Section:
    found = curves(study, corpus, list(corpus.sets), [KIND])
    pairs = tuple(pair for pair in corpus.sets if all(found.sizes([pair], KIND, split) for split in SPLITS))
    if not pairs:
        return Section("", "", (), notes=(f"{corpus.name}: too few windows for a learning curve.",))
    findings = (circle(corpus, found, pairs), surface(corpus, found, pairs), saturation(corpus, found, pairs))
    pictures = [_picture(study, corpus, found, pairs, number, axis) for axis in AXES]
    tables = (_table(corpus, found, pairs), _group_table(corpus, found, pairs))
    return Section("", "", findings, tables, tuple(pictures), _notes(study, corpus, found, pairs), _data(found, pairs))


def _picture(
    study: Study, corpus: Corpus, found: Curves, pairs: Sequence[Pair], number: int, axis: tuple[str, int]
) -> Picture:
    """NMSE and NLPD by training size, one row per split: a thick line per group, thin lines for its members."""
    name, place = axis
    rows = [
        [
            Panel(
                SPLIT_WORDS[split],
                AXIS_NAMES[label],
                _lines(found, pairs, split, measure, place),
                ratio=label == "NMSE",
            )
            for label, measure, _ in MEASURES
        ]
        for split in SPLITS
    ]
    path = study.out / f"learning_curves_{name}_{corpus.origin}_{number}.png"
    draw(path, (7.4, 6.4), lambda figure: paint_panels(figure, rows))
    other = "shape" if name == "surface" else "surface"
    caption = (
        f"VHGP by training size, per {name}. Thick: mean over {other}s, with 95 % interval over folds or draws (with "
        f"fewer than {FEWEST_FOR_BAND}, whiskers show their range); thin: each {other}. Above: {SPLIT_WORDS['push']}; "
        f"below: {SPLIT_WORDS['random']}. Sums over the three outputs, NLPD in SI units. A triangle at the top marks a "
        f"mean beyond the axis. {NOT_INCLUDED} Pushes: {corpus.name}, {pushes_of(corpus, pairs)} in all."
    )
    return Picture(path, f"Learning curves of the VHGP per {name}: NMSE and NLPD over training size", caption)


def _lines(found: Curves, pairs: Sequence[Pair], split: SplitName, measure: Measure, place: int) -> tuple[Line, ...]:
    names = list(dict.fromkeys(pair[place] for pair in pairs))
    lines = []
    for k, name in enumerate(names):
        group = [pair for pair in pairs if pair[place] == name]
        members = [[pair] for pair in group] if len(group) > 1 else []
        for part, thin in [(member, True) for member in members] + [(group, False)]:
            sizes = found.sizes(part, KIND, split)
            values = [found.values(part, KIND, split, n, measure) for n in sizes]
            points = tuple(map(band_or_range, values))
            banded = all(len(of_size) >= FEWEST_FOR_BAND for of_size in values)
            lines.append(Line(word(name), look_of(k), sizes, points, thin, banded))
    return tuple(lines)


def band_or_range(values: Sequence[float]) -> Estimate:
    """The mean over folds with Student's interval; with few folds, their range."""
    if len(values) >= FEWEST_FOR_BAND:
        return over_seeds(values)
    return Estimate(float(np.mean(values)), min(values), max(values))


def _table(corpus: Corpus, found: Curves, pairs: Sequence[Pair]) -> Table:
    """A row per pair, at the largest size that all pairs have."""
    rows = [(f"{word(shape)}, {material}", [(shape, material)]) for shape, material in pairs]
    return _scores_table(corpus, found, pairs, rows, "VHGP by pair of shape and surface at the last common size")


def _group_table(corpus: Corpus, found: Curves, pairs: Sequence[Pair]) -> Table:
    """A row per surface and per shape: means over their pairs."""
    rows = [
        (f"{word(name)} (mean of {len(group)})", group)
        for _, place in AXES
        for name in dict.fromkeys(pair[place] for pair in pairs)
        for group in [[pair for pair in pairs if pair[place] == name]]
    ]
    return _scores_table(corpus, found, pairs, rows, "The same, means by surface and by shape")


def _scores_table(
    corpus: Corpus, found: Curves, pairs: Sequence[Pair], groups: Sequence[tuple[str, list[Pair]]], what: str
) -> Table:
    last = {split: found.sizes(pairs, KIND, split)[-1] for split in SPLITS}
    columns = [(split, label, measure, form) for split in SPLITS for label, measure, form in MEASURES]
    head = tuple(f"{label}, {_short(split)}, n = {last[split]}" for split, label, _, _ in columns)
    rows = tuple(
        (name, *(found.over_seeds(group, KIND, s, last[s], measure).cell(form) for s, _, measure, form in columns))
        for name, group in groups
    )
    caption = (
        f"{what}. Pushes: {corpus.name}, {pushes_of(corpus, pairs)} in all. By push: {SPLIT_WORDS['push']}. Student's "
        f"interval of the mean over folds (by push) or draws of training windows (random). {NOT_INCLUDED} The paper "
        "shows these curves without numbers."
    )
    return Table(caption, ("", *head), rows)


def _short(split: SplitName) -> str:
    return "by push" if split == "push" else "random"


def _notes(study: Study, corpus: Corpus, found: Curves, pairs: Sequence[Pair]) -> tuple[str, ...]:
    notes = [
        f"{corpus.name}: {_short(split)}, the means do not show n = {', '.join(map(str, missing))}, because a set is "
        "too small for it."
        for split in SPLITS
        if (missing := sorted(set(sizes_tried(study.plan, False)) - set(found.sizes(pairs, KIND, split))))
    ]
    if corpus.origin == "simulated":
        notes.append(SIMULATOR)
    return tuple(notes)


def _data(found: Curves, pairs: Sequence[Pair]) -> dict[str, Any]:
    return {
        f"{shape}/{material}": {
            split: [
                {
                    "n": n,
                    **{
                        label: found.over_seeds([(shape, material)], KIND, split, n, m).json()
                        for label, m, _ in MEASURES
                    },
                }
                for n in found.sizes([(shape, material)], KIND, split)
            ]
            for split in SPLITS
        }
        for shape, material in pairs
    }

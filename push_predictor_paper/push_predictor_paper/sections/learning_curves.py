# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""NMSE and NLPD against training size, per surface and per shape (paper, section VI-A, figures 7 and 8)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from push_predictor.evaluation.estimate import Estimate, of_draws, total_nlpd, total_nmse
from push_predictor.evaluation.estimate import Figure as Statistic
from push_predictor.reporting.canvas import Picture
from push_predictor.types import Array
from push_predictor_paper.claims import ENOUGH
from push_predictor_paper.data.corpus import Corpus, Pair
from push_predictor_paper.estimate import over_seeds
from push_predictor_paper.fits.curves import Curves, curves
from push_predictor_paper.fits.fit import SPLIT_SHORT, SPLIT_WORDS, SPLITS, SplitName
from push_predictor_paper.painters.curves import LOOKS, Line, Panel, paint_curves
from push_predictor_paper.section import Number, Section, Table, TooFewError, picture
from push_predictor_paper.study import Study
from push_predictor_paper.verdict import Evidence, Figure

KIND, CIRCLE = "vhgp", "ellip1"
SHAPE_WORDS = {"rect1": "square", CIRCLE: "circle", "ellip2": "ellipse 2", "ellip3": "ellipse 3"}
MEASURES: tuple[tuple[str, Statistic, str], ...] = (("NMSE", total_nmse, ".3f"), ("NLPD", total_nlpd, ".2f"))
FEWEST_FOR_BAND = 3  # folds
AXES = (("surface", 1), ("shape", 0))  # what a figure compares, and its place in a pair
NOTES = (
    "Folds share training windows, and all draws of the random split share one test set. The intervals do not include "
    "the effect of another recording or other test windows.",
    "The simulated surfaces differ in their friction, its variation over the table, and the fit of slider and table. "
    "How much the surface matters here is an assumption (push_predictor/simulation/surface.py) and shows nothing about "
    "real materials. As on the rig, the contact point of a circle is redundant up to uneven pressure.",
)


def section(study: Study, corpus: Corpus) -> Section:
    """Learning curves of the VHGP on every pair of shape and surface of a corpus."""
    found = curves(study, corpus, list(corpus.sets), [KIND])
    pairs = tuple(pair for pair in corpus.sets if all(found.sizes([pair], KIND, split) for split in SPLITS))
    if not pairs:
        raise TooFewError(f"{corpus.name}: too few windows for a learning curve.")
    axes = [axis for axis in AXES if len({pair[axis[1]] for pair in pairs}) > 1] or AXES[:1]
    evidence = {"circle": circle(found, pairs), "surface": surface(found, pairs)}
    return Section(
        {**evidence, "saturation": saturation(found, pairs)},
        (_table(corpus, found, pairs),),
        [_picture(study, corpus, found, pairs, axis) for axis in axes],
        NOTES,
    )


def circle(found: Curves, pairs: Sequence[Pair]) -> Evidence:
    """Is the circle easier than each other shape? Differences paired by surface, mean over folds, split by push."""
    others = sorted({shape for shape, _ in pairs} - {CIRCLE})
    sizes = found.sizes(pairs, KIND, "push")
    if not sizes or not others or CIRCLE not in {shape for shape, _ in pairs}:
        return Evidence(note="No circle and other shape with a common training size.")
    figures = [
        Figure(f"{_word(shape)} {name}", _harder(found, pairs, shape, sizes[-1], measure))
        for shape in others
        for name, measure, _ in MEASURES
    ]
    note = (
        f"n = {sizes[-1]}, mean over folds, {SPLIT_WORDS['push']}; interval over surfaces, each one difference "
        "(Student; one surface gives none), not corrected for the number of differences."
    )
    return Evidence(figures, note)


def surface(found: Curves, pairs: Sequence[Pair]) -> Evidence:
    """Does the surface matter little? Spread over surfaces against spread over shapes, split by push."""
    sizes, whole = found.sizes(pairs, KIND, "push"), _complete(pairs)
    if not sizes or not whole:
        return Evidence(note="Not every shape is there on each of several surfaces.")
    note = (
        f"Standard deviations of the means at n = {sizes[-1]}, {SPLIT_WORDS['push']}; intervals resample the pushes of "
        "each set and hold for these surfaces and shapes only."
    )
    return Evidence([Figure(name, _spreads(found, whole, sizes[-1], measure)) for name, measure, _ in MEASURES], note)


def saturation(found: Curves, pairs: Sequence[Pair]) -> Evidence:
    """Is performance flat before 1000 windows? Gain of the last doubling up to there, split by push."""
    sizes = [n for n in found.sizes(pairs, KIND, "push") if n <= ENOUGH]
    if len(sizes) < 2:
        return Evidence(note="Fewer than two training sizes.")
    figures = []
    for name, measure, _ in MEASURES:
        gain = _last_gain(found, pairs, sizes[-2:], measure)
        # at fewer windows a gain shows only that performance has not saturated yet
        known = gain if sizes[-1] >= ENOUGH else Estimate(gain.value, -np.inf, gain.high)
        figures.append(Figure(name, known, text=gain.text()))
    of = "one set, interval by push" if len(pairs) == 1 else f"mean over {len(pairs)} sets, with its interval (Student)"
    note = f"From n = {sizes[-2]} to {sizes[-1]}, {SPLIT_WORDS['push']}; {of}."
    return Evidence(figures, note)


def _word(shape: str) -> str:
    """A shape's name for a reader."""
    return SHAPE_WORDS.get(shape, shape)


def _harder(found: Curves, pairs: Sequence[Pair], shape: str, n: int, measure: Statistic) -> Estimate:
    gaps: list[float] = []
    for other, surface_name in pairs:
        if other == shape and (CIRCLE, surface_name) in pairs:
            mine, round_ = (
                np.mean(found.values([(s, surface_name)], KIND, "push", n, measure)) for s in (shape, CIRCLE)
            )
            gaps.append(float(mine - round_))
    return over_seeds(gaps) if gaps else Estimate(np.nan, np.nan, np.nan)


def _complete(pairs: Sequence[Pair]) -> list[list[Pair]]:
    """Pairs as a grid, shapes by surfaces, of the shapes that every surface has; empty if there is no such grid."""
    surfaces = sorted({surface_name for _, surface_name in pairs})
    shapes = [s for s in sorted({s for s, _ in pairs}) if all((s, u) in pairs for u in surfaces)]
    return [[(s, u) for u in surfaces] for s in shapes] if len(shapes) > 1 and len(surfaces) > 1 else []


def _spreads(found: Curves, whole: list[list[Pair]], n: int, measure: Statistic) -> Estimate:
    """Spread over surfaces divided by that over shapes."""
    values, draws = [], []
    for k, pair in enumerate(pair for row in whole for pair in row):
        push_scores = found.push_scores(pair, KIND, "push", n)
        values.append(measure(push_scores.totals()))
        draws.append(measure(push_scores.resampled(k)))  # a seed of its own: the sets are of different pushes
    shape = (len(whole), len(whole[0]), -1)
    return of_draws(float(_ratio(np.reshape(values, shape))[0]), _ratio(np.reshape(draws, shape)))


def _ratio(cube: Array) -> Array:
    """Sd of the means by surface over that of the means by shape, (d,), of figures (shapes, surfaces, d)."""
    surfaces, shapes = cube.mean(axis=0).std(axis=0, ddof=1), cube.mean(axis=1).std(axis=0, ddof=1)
    return np.asarray(np.divide(surfaces, shapes, out=np.full_like(shapes, np.inf), where=shapes > 0.0))


def _last_gain(found: Curves, pairs: Sequence[Pair], sizes: Sequence[int], measure: Statistic) -> Estimate:
    """Gain between two sizes per doubling, relative in NMSE, else in nats: by push of one set, over several sets."""
    doublings = float(np.log2(sizes[1] / sizes[0]))

    def gain(before: Array, after: Array) -> Array:
        return 1.0 - (after / before) ** (1.0 / doublings) if measure is total_nmse else (before - after) / doublings

    if len(pairs) == 1:
        both = [found.push_scores(pairs[0], KIND, "push", n) for n in sizes]
        value = gain(*(measure(scores.totals()) for scores in both))
        return of_draws(float(value[0]), gain(*(measure(scores.resampled()) for scores in both)))
    means = [[np.array(np.mean(found.values([pair], KIND, "push", n, measure))) for n in sizes] for pair in pairs]
    return over_seeds([float(gain(*of_pair)) for of_pair in means])


def _picture(study: Study, corpus: Corpus, found: Curves, pairs: Sequence[Pair], axis: tuple[str, int]) -> Picture:
    """NMSE and NLPD by training size, one row per split: a thick line per group, thin lines for its members."""
    name, place = axis
    ticks = sorted({n for split in SPLITS for pair in pairs for n in found.sizes([pair], KIND, split)})
    rows = [
        [
            Panel(
                SPLIT_WORDS[split],
                "training windows n",
                f"{label}, sum of 3",
                _lines(found, pairs, split, measure, place),
                ticks,
                ratio=label == "NMSE",
            )
            for label, measure, _ in MEASURES
        ]
        for split in SPLITS
    ]
    return picture(
        study.file("learning_curves", corpus, name),
        (7.4, 6.4),
        partial(paint_curves, rows=rows),
        f"Learning curves of the VHGP per {name}: NMSE and NLPD over training size. Thick: mean over the sets of a "
        f"{name}, with Student's interval over folds or draws (with fewer than {FEWEST_FOR_BAND}, whiskers show their "
        "range); thin: each set. Sums over the three outputs, NLPD in SI units. A triangle at the top marks a mean "
        f"beyond the axis. Pushes: {corpus.name}.",
    )


def _lines(found: Curves, pairs: Sequence[Pair], split: SplitName, measure: Statistic, place: int) -> list[Line]:
    lines = []
    for k, name in enumerate(dict.fromkeys(pair[place] for pair in pairs)):
        group = [pair for pair in pairs if pair[place] == name]
        members = [[pair] for pair in group] if len(group) > 1 else []
        for part, thin in [(member, True) for member in members] + [(group, False)]:
            sizes = found.sizes(part, KIND, split)
            values = [found.values(part, KIND, split, n, measure) for n in sizes]
            banded = all(len(of_size) >= FEWEST_FOR_BAND for of_size in values)
            lines.append(Line(_word(name), LOOKS[k], sizes, list(map(band_or_range, values)), thin, banded))
    return lines


def band_or_range(values: Sequence[float]) -> Estimate:
    """The mean over folds with Student's interval; with few folds, their range."""
    if len(values) >= FEWEST_FOR_BAND:
        return over_seeds(values)
    return Estimate(float(np.mean(values)), min(values), max(values))


def _table(corpus: Corpus, found: Curves, pairs: Sequence[Pair]) -> Table:
    """A row per pair, at the largest size that all pairs have."""
    last = {split: found.sizes(pairs, KIND, split)[-1] for split in SPLITS}
    columns = [(split, label, measure, form) for split in SPLITS for label, measure, form in MEASURES]
    head = tuple(f"{label}, {SPLIT_SHORT[split]}, n = {last[split]}" for split, label, _, _ in columns)
    rows = [
        (
            f"{_word(pair[0])}, {pair[1]}",
            *(
                Number(over_seeds(found.values([pair], KIND, s, last[s], measure)), form)
                for s, _, measure, form in columns
            ),
        )
        for pair in pairs
    ]
    caption = (
        f"VHGP by pair of shape and surface at the last common size. Pushes: {corpus.name}. By push: "
        f"{SPLIT_WORDS['push']}. Student's interval of the mean over folds (by push) or draws of training windows "
        "(random). The paper shows these curves without numbers."
    )
    return Table(caption, ("", *head), rows)

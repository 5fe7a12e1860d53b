# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Verdicts on learning curves: is the circle easiest, does the surface matter, does performance saturate?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from push_predictor.evaluation.push_scores import PooledScores
from push_predictor.types import Array
from push_predictor_paper.data.corpus import Corpus, Pair
from push_predictor_paper.estimate import Estimate, Figure, of_draws, over_seeds, total_nlpd, total_nmse
from push_predictor_paper.fits.curves import Curves, Measure, nlpd_of, nmse_of
from push_predictor_paper.fits.fit import SPLIT_WORDS
from push_predictor_paper.section import Finding, Verdict

KIND, CIRCLE = "vhgp", "ellip1"
SHAPE_WORDS = {"rect1": "square", CIRCLE: "circle", "ellip2": "ellipse 2", "ellip3": "ellipse 3"}
MEASURES: tuple[tuple[str, Measure, str], ...] = (("NMSE", nmse_of, ".3f"), ("NLPD", nlpd_of, ".2f"))
FIGURES: tuple[tuple[str, Figure], ...] = (("NMSE", total_nmse), ("NLPD", total_nlpd))
ENOUGH = 1000  # training windows below which the paper sees performance saturate
SATURATED, SATURATED_NATS = 0.10, 0.10  # gain of a doubling below which a curve counts as flat
LITTLE, AS_MUCH = 0.5, 1.0  # spread over surfaces, as a share of that over shapes


def word(shape: str) -> str:
    """A shape's name for a reader."""
    return SHAPE_WORDS.get(shape, shape)


def pushes_of(corpus: Corpus, pairs: Sequence[Pair]) -> int:
    """The number of pushes in these sets."""
    return sum(len(corpus.sets[pair].table.pushes) for pair in pairs)


def judged(found: Curves, pairs: Sequence[Pair], n: int) -> int:
    """The number of test pushes of these sets, split by push."""
    return sum(len(found.push_scores(pair, KIND, "push", n).windows) for pair in pairs)


def circle(corpus: Corpus, found: Curves, pairs: Sequence[Pair]) -> Finding:
    """Is the circle easier than each other shape? Differences paired by surface, mean over folds, split by push."""
    claim = f"The circle is easier to learn than the other shapes ({corpus.name})"
    others = sorted({shape for shape, _ in pairs} - {CIRCLE})
    sizes = found.sizes(pairs, KIND, "push")
    if not sizes or not others or CIRCLE not in {shape for shape, _ in pairs}:
        return Finding(claim, "not decided", f"{corpus.name}: no circle and other shape with a common training size.")
    listed, wins, losses = [], 0, 0
    for shape in others:
        for name, measure, form in MEASURES:
            gap = _harder(found, pairs, shape, sizes[-1], measure)
            wins, losses = wins + (gap.low > 0.0), losses + (gap.high < 0.0)
            listed.append(f"{word(shape)} {name} {gap.text(form)}")
    verdict = _counted(wins, losses, 2 * len(others))
    sentence = (
        f"Score of the other shape minus that of the circle at n = {sizes[-1]}: {'; '.join(listed)}. Mean over folds, "
        f"{SPLIT_WORDS['push']}, {judged(found, pairs, sizes[-1])} pushes; interval over surfaces, each one difference "
        "(Student; one surface gives none). Rule: holds if all of these lie above 0, in part if half of them do, does "
        "not hold if some lie below and fewer above. The intervals are not corrected for their number."
    )
    return Finding(claim, verdict, sentence, number=f"{wins} of {2 * len(others)} differences above 0, {losses} below")


def surface(corpus: Corpus, found: Curves, pairs: Sequence[Pair]) -> Finding:
    """Does the surface matter little? Spread over surfaces against spread over shapes, split by push."""
    claim = f"The model is not very sensitive to the surface ({corpus.name})"
    sizes, whole = found.sizes(pairs, KIND, "push"), _complete(pairs)
    if not sizes or not whole:
        return Finding(claim, "not decided", f"{corpus.name}: not every shape is there on each of several surfaces.")
    ratios, spreads = [], []
    for name, figure in FIGURES:
        ratio, spread = _spreads(found, whole, sizes[-1], figure)
        ratios.append(ratio)
        spreads.append(f"{name}: surfaces {spread[0]:.3g}, shapes {spread[1]:.3g}, resampling pushes {spread[2]:.3g}")
    sentence = (
        f"Spread over surfaces divided by spread over shapes: NMSE {ratios[0].text()}, NLPD {ratios[1].text()}. "
        f"Standard deviations of the means at n = {sizes[-1]}: {'; '.join(spreads)}. "
        f"{SPLIT_WORDS['push'].capitalize()}, {judged(found, pairs, sizes[-1])} pushes; intervals resample the "
        "pushes of each set and hold for these surfaces and shapes only. Rule: holds if both intervals end below "
        f"{LITTLE}; does not hold if both begin above {AS_MUCH:g}; in part if one ends below {LITTLE} or both below "
        f"{AS_MUCH:g}."
    )
    return Finding(claim, _little(ratios), sentence, number=f"surfaces over shapes: NMSE {ratios[0].text()}")


def saturation(corpus: Corpus, found: Curves, pairs: Sequence[Pair]) -> Finding:
    """Is performance flat before 1000 windows? Gain of the last doubling up to there, split by push."""
    claim = f"Performance saturates below {ENOUGH} samples ({corpus.name})"
    sizes = [n for n in found.sizes(pairs, KIND, "push") if n <= ENOUGH]
    if len(sizes) < 2:
        return Finding(claim, "not decided", f"{corpus.name}: fewer than two training sizes.")
    nmse, nats = _last_gains(found, pairs, sizes[-2], sizes[-1])
    sentence = (
        f"From n = {sizes[-2]} to {sizes[-1]} a doubling lowers the NMSE by {_percent(nmse)} and the NLPD by "
        f"{nats.text()} nats; {_over(pairs)}, {SPLIT_WORDS['push']}, {judged(found, pairs, sizes[-1])} pushes. "
        f"{_beyond(corpus, found)}Rule: a score is flat if the whole interval of its gain lies below {SATURATED:.0%} "
        f"(NMSE) or {SATURATED_NATS:g} nats (NLPD). Holds if both are flat, in part if one is; does not hold if "
        f"neither is and one clearly still falls at n = {ENOUGH}; else not decided."
    )
    number = f"NMSE falls by {_percent(nmse)} from n = {sizes[-2]} to {sizes[-1]}"
    return Finding(claim, _flat(nmse, nats, sizes[-1] >= ENOUGH), sentence, number=number)


def _harder(found: Curves, pairs: Sequence[Pair], shape: str, n: int, measure: Measure) -> Estimate:
    gaps: list[float] = []
    for other, surface_name in pairs:
        if other == shape and (CIRCLE, surface_name) in pairs:
            mine, round_ = (
                np.mean(found.values([(s, surface_name)], KIND, "push", n, measure)) for s in (shape, CIRCLE)
            )
            gaps.append(float(mine - round_))
    return over_seeds(gaps) if gaps else Estimate(np.nan, np.nan, np.nan)


def _counted(wins: int, losses: int, count: int) -> Verdict:
    if wins == count:
        return "holds"
    if 2 * wins >= count:
        return "holds in part"
    return "does not hold" if losses > wins else "not decided"


def _complete(pairs: Sequence[Pair]) -> list[list[Pair]]:
    """Pairs as a grid, shapes by surfaces, of the shapes that every surface has; empty if there is no such grid."""
    surfaces = sorted({surface_name for _, surface_name in pairs})
    shapes = [s for s in sorted({s for s, _ in pairs}) if all((s, u) in pairs for u in surfaces)]
    return [[(s, u) for u in surfaces] for s in shapes] if len(shapes) > 1 and len(surfaces) > 1 else []


def _spreads(found: Curves, whole: list[list[Pair]], n: int, figure: Figure) -> tuple[Estimate, tuple[float, ...]]:
    """Spread over surfaces / over shapes; then the spreads: over surfaces, over shapes, of a set by push."""
    values, draws = [], []
    for k, pair in enumerate(pair for row in whole for pair in row):
        push_scores = found.push_scores(pair, KIND, "push", n)
        values.append(figure(push_scores.totals()))
        draws.append(figure(push_scores.resampled(k)))  # a seed of its own: the sets are of different pushes
    shape = (len(whole), len(whole[0]), -1)
    cube, drawn = np.reshape(values, shape), np.reshape(draws, shape)
    surfaces, shapes = _sides(cube)
    ratios = of_draws(float(_ratio(cube)[0]), _ratio(drawn))
    return ratios, (float(surfaces[0]), float(shapes[0]), float(drawn.std(axis=2).mean()))


def _sides(cube: Array) -> tuple[Array, Array]:
    """Sd (d,) of the means by surface and by shape of figures (shapes, surfaces, d)."""
    return cube.mean(axis=0).std(axis=0, ddof=1), cube.mean(axis=1).std(axis=0, ddof=1)


def _ratio(cube: Array) -> Array:
    surfaces, shapes = _sides(cube)
    return np.divide(surfaces, shapes, out=np.full_like(shapes, np.inf), where=shapes > 0.0)


def _little(ratios: Sequence[Estimate]) -> Verdict:
    if all(ratio.high < LITTLE for ratio in ratios):
        return "holds"
    if all(ratio.low > AS_MUCH for ratio in ratios):
        return "does not hold"
    some = any(ratio.high < LITTLE for ratio in ratios) or all(ratio.high < AS_MUCH for ratio in ratios)
    return "holds in part" if some else "not decided"


def _last_gains(found: Curves, pairs: Sequence[Pair], n: int, more: int) -> tuple[Estimate, Estimate]:
    """Relative gain in NMSE and gain in nats, per doubling; see _over for what the intervals are."""
    if len(pairs) == 1:
        return _gains_by_push(found, pairs[0], n, more)
    doublings = float(np.log2(more / n))
    nmse, nats = [], []
    for pair in pairs:
        a, b = (np.mean(found.values([pair], KIND, "push", size, nmse_of)) for size in (n, more))
        nmse.append(float(1.0 - (b / a) ** (1.0 / doublings)))
        a, b = (np.mean(found.values([pair], KIND, "push", size, nlpd_of)) for size in (n, more))
        nats.append(float((a - b) / doublings))
    return over_seeds(nmse), over_seeds(nats)


def _gains_by_push(found: Curves, pair: Pair, n: int, more: int) -> tuple[Estimate, Estimate]:
    before, after = (found.push_scores(pair, KIND, "push", size) for size in (n, more))
    doublings = float(np.log2(more / n))

    def nmse(a: PooledScores, b: PooledScores) -> Array:
        return np.asarray(1.0 - (total_nmse(b) / total_nmse(a)) ** (1.0 / doublings))

    def nats(a: PooledScores, b: PooledScores) -> Array:
        return np.asarray((total_nlpd(a) - total_nlpd(b)) / doublings)

    all_pushes, drawn = (before.totals(), after.totals()), (before.resampled(), after.resampled())
    by_nmse, by_nats = (of_draws(float(gain(*all_pushes)[0]), gain(*drawn)) for gain in (nmse, nats))
    return by_nmse, by_nats


def _over(pairs: Sequence[Pair]) -> str:
    """The kind of interval of a gain, in words."""
    if len(pairs) == 1:
        return "one set, all folds, interval by push"
    return f"mean over {len(pairs)} sets, each the mean of its folds, with its interval (Student)"


def _beyond(corpus: Corpus, found: Curves) -> str:
    """The gain from a still larger size, on the reference pair."""
    sizes = found.sizes([corpus.reference], KIND, "push")
    if len(sizes) < 2 or sizes[-1] <= ENOUGH:
        return ""
    nmse, nats = _last_gains(found, [corpus.reference], sizes[-2], sizes[-1])
    return (
        f"On the reference pair a doubling from {sizes[-2]} gains {_percent(nmse)} and {nats.text()} nats (interval by "
        "push). "
    )


def _flat(nmse: Estimate, nats: Estimate, far_enough: bool) -> Verdict:
    flat = [nmse.high < SATURATED, nats.high < SATURATED_NATS]
    if all(flat):
        return "holds"
    if any(flat):
        return "holds in part"
    falling = nmse.low > SATURATED or nats.low > SATURATED_NATS
    return "does not hold" if far_enough and falling else "not decided"


def _percent(share: Estimate) -> str:
    return Estimate(*(100.0 * v for v in (share.value, share.low, share.high))).text(".1f") + " %"

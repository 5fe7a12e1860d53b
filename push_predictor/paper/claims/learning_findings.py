"""What learning curves say: is the circle easiest, does the surface matter, is performance flat before 1000."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from push_predictor.paper.corpus import Corpus, Pair
from push_predictor.paper.curves import Curves, Measure, nlpd_of, nmse_of
from push_predictor.paper.estimate import Estimate, of_draws, over_seeds
from push_predictor.paper.fits import SPLIT_WORDS
from push_predictor.paper.section import Finding, Verdict

KIND, CIRCLE = "vhgp", "ellip1"
SHAPE_WORDS = {"rect1": "square", CIRCLE: "circle", "ellip2": "ellipse 2", "ellip3": "ellipse 3"}
MEASURES: tuple[tuple[str, Measure, str], ...] = (("NMSE", nmse_of, ".3f"), ("NLPD", nlpd_of, ".2f"))
ENOUGH = 1000  # training windows below which the paper sees performance saturate
SATURATED, SATURATED_NATS = 0.10, 0.10  # gain of a doubling below which a curve counts as flat
LITTLE, AS_MUCH = 0.5, 1.0  # spread over surfaces, as a share of that over shapes
DRAWS = 1000


def word(shape: str) -> str:
    """A shape's name for a reader."""
    return SHAPE_WORDS.get(shape, shape)


def pushes_of(corpus: Corpus, pairs: Sequence[Pair]) -> int:
    """How many pushes these sets hold."""
    return sum(len(corpus.sets[pair].table.pushes) for pair in pairs)


def judged(found: Curves, pairs: Sequence[Pair], n: int) -> int:
    """How many pushes of these sets were judged, split by push."""
    return sum(len(found.tally(pair, KIND, "push", n).windows) for pair in pairs)


def circle(corpus: Corpus, found: Curves, pairs: Sequence[Pair]) -> Finding:
    """Is the circle easier than each other shape: differences paired by surface and fold, split by push."""
    claim = f"The circle is easier to learn than the other shapes ({corpus.origin})"
    others = sorted({shape for shape, _ in pairs} - {CIRCLE})
    sizes = found.sizes(pairs, KIND, "push")
    if not sizes or not others or CIRCLE not in {shape for shape, _ in pairs}:
        return Finding(claim, "not decided", f"{corpus.title}: needs the circle and another shape at a common size.")
    told, wins, losses = [], 0, 0
    for shape in others:
        for name, measure, form in MEASURES:
            gap = _harder(found, pairs, shape, sizes[-1], measure)
            wins, losses = wins + (gap.low > 0.0), losses + (gap.high < 0.0)
            told.append(f"{word(shape)} {name} {gap.text(form)}")
    verdict = _counted(wins, losses, 2 * len(others))
    sentence = (
        f"The other shape's figure less the circle's at n = {sizes[-1]}, paired by surface and fold, "
        f"{SPLIT_WORDS['push']}, {judged(found, pairs, sizes[-1])} pushes, interval of the mean over surfaces and "
        f"folds: {'; '.join(told)}. Holds if all of these lie above 0, does not hold if some lie below and none above, "
        "in part if some do."
    )
    return Finding(claim, verdict, sentence)


def surface(corpus: Corpus, found: Curves, pairs: Sequence[Pair]) -> Finding:
    """Does the surface matter little: spread over surfaces against spread over shapes, split by push."""
    claim = f"The model is not very sensitive to the surface ({corpus.origin})"
    sizes, whole = found.sizes(pairs, KIND, "push"), _complete(pairs)
    if not sizes or not whole:
        return Finding(claim, "not decided", f"{corpus.title}: needs every shape on every one of several surfaces.")
    ratios, spreads = [], []
    for name, measure, _ in MEASURES:
        ratio, spread = _spreads(found, whole, sizes[-1], measure)
        ratios.append(ratio)
        spreads.append(f"{name}: surfaces {spread[0]:.3g}, shapes {spread[1]:.3g}, folds {spread[2]:.3g}")
    sentence = (
        f"At n = {sizes[-1]}, {SPLIT_WORDS['push']}, {judged(found, pairs, sizes[-1])} pushes, standard deviation of "
        f"the means by group: {'; '.join(spreads)}. Surfaces over shapes: NMSE {ratios[0].text()}, NLPD "
        f"{ratios[1].text()} (interval by drawing folds anew). Holds if both intervals end below {LITTLE}, does not "
        f"hold if both begin above {AS_MUCH:g}, in part if only one ends below {LITTLE}, or both below {AS_MUCH:g}."
    )
    return Finding(claim, _little(ratios), sentence)


def saturation(corpus: Corpus, found: Curves, pairs: Sequence[Pair]) -> Finding:
    """Is performance flat before 1000 windows: gain of the last doubling up to there, split by push."""
    claim = f"Performance saturates with less than {ENOUGH} samples ({corpus.origin})"
    sizes = [n for n in found.sizes(pairs, KIND, "push") if n <= ENOUGH]
    if len(sizes) < 2:
        return Finding(claim, "not decided", f"{corpus.title}: fewer than two training sizes.")
    nmse, nats = _last_gains(found, pairs, sizes[-2], sizes[-1])
    sentence = (
        f"From n = {sizes[-2]} to {sizes[-1]} a doubling lowers the NMSE by {_percent(nmse)}, the NLPD by "
        f"{nats.text()} nats; mean over {len(pairs)} pairs and their folds with its interval, {SPLIT_WORDS['push']}, "
        f"{judged(found, pairs, sizes[-1])} pushes. {_beyond(corpus, found)}Saturated means: a doubling gains less "
        f"than {SATURATED:.0%} of the NMSE and less than {SATURATED_NATS:g} nats with the whole interval; in part if "
        f"one of the two is; does not hold if neither is and one surely falls up to n = {ENOUGH}; else not decided."
    )
    return Finding(claim, _flat(nmse, nats, sizes[-1] >= ENOUGH), sentence)


def _harder(found: Curves, pairs: Sequence[Pair], shape: str, n: int, measure: Measure) -> Estimate:
    gaps: list[float] = []
    for other, surface_name in pairs:
        if other == shape and (CIRCLE, surface_name) in pairs:
            mine = found.values([(shape, surface_name)], KIND, "push", n, measure)
            round_ = found.values([(CIRCLE, surface_name)], KIND, "push", n, measure)
            gaps += [a - b for a, b in zip(mine, round_, strict=False)]
    return over_seeds(gaps) if gaps else Estimate(np.nan, np.nan, np.nan)


def _counted(wins: int, losses: int, count: int) -> Verdict:
    if wins == count:
        return "holds"
    if wins:
        return "holds in part"
    return "does not hold" if losses else "not decided"


def _complete(pairs: Sequence[Pair]) -> list[list[Pair]]:
    """Pairs as a grid, shapes by surfaces, of the shapes that every surface has; empty if there is no such grid."""
    surfaces = sorted({surface_name for _, surface_name in pairs})
    shapes = [s for s in sorted({s for s, _ in pairs}) if all((s, u) in pairs for u in surfaces)]
    return [[(s, u) for u in surfaces] for s in shapes] if len(shapes) > 1 and len(surfaces) > 1 else []


def _spreads(found: Curves, whole: list[list[Pair]], n: int, measure: Measure) -> tuple[Estimate, tuple[float, ...]]:
    """Spread over surfaces / over shapes; and the spreads over surfaces, shapes, folds."""
    rows = [[found.values([pair], KIND, "push", n, measure) for pair in row] for row in whole]
    folds = min(len(values) for row in rows for values in row)
    cube = np.array([[values[:folds] for values in row] for row in rows])  # shapes, surfaces, folds
    drawn = np.random.default_rng(0).integers(0, folds, (DRAWS, folds))
    draws = [_ratio(cube[:, :, fold]) for fold in drawn]
    over_folds = float(cube.mean(axis=(0, 1)).std(ddof=1)) if folds > 1 else np.nan
    return of_draws(_ratio(cube), np.array(draws)), (*_sides(cube), over_folds)


def _sides(cube: np.ndarray) -> tuple[float, float]:
    mean = cube.mean(axis=2)
    return float(mean.mean(axis=0).std(ddof=1)), float(mean.mean(axis=1).std(ddof=1))


def _ratio(cube: np.ndarray) -> float:
    surfaces, shapes = _sides(cube)
    return surfaces / shapes if shapes > 0.0 else np.inf


def _little(ratios: Sequence[Estimate]) -> Verdict:
    if all(ratio.high < LITTLE for ratio in ratios):
        return "holds"
    if all(ratio.low > AS_MUCH for ratio in ratios):
        return "does not hold"
    some = any(ratio.high < LITTLE for ratio in ratios) or all(ratio.high < AS_MUCH for ratio in ratios)
    return "holds in part" if some else "not decided"


def _last_gains(found: Curves, pairs: Sequence[Pair], n: int, more: int) -> tuple[Estimate, Estimate]:
    """Relative gain in NMSE and gain in nats, per doubling, over all pairs and their folds."""
    doublings = float(np.log2(more / n))
    nmse, nats = [], []
    for pair in pairs:
        before, after = (found.values([pair], KIND, "push", size, nmse_of) for size in (n, more))
        nmse += [1.0 - (b / a) ** (1.0 / doublings) for a, b in zip(before, after, strict=True)]
        before, after = (found.values([pair], KIND, "push", size, nlpd_of) for size in (n, more))
        nats += [(a - b) / doublings for a, b in zip(before, after, strict=True)]
    return over_seeds(nmse), over_seeds(nats)


def _beyond(corpus: Corpus, found: Curves) -> str:
    """What a still larger size adds, on the reference pair."""
    sizes = found.sizes([corpus.reference], KIND, "push")
    if len(sizes) < 2 or sizes[-1] <= ENOUGH:
        return ""
    nmse, nats = _last_gains(found, [corpus.reference], sizes[-2], sizes[-1])
    return f"On the reference pair a doubling from {sizes[-2]} gains {_percent(nmse)} and {nats.text()} nats. "


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

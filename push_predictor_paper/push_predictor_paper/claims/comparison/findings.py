"""What the comparison of models says: who beats whom, from how many windows on, in what."""

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
PAPER_SIZE = 100  # training windows from about which on the paper sees both learnt models ahead
ABOUT = 150  # what "about" may mean
SIMILAR = 0.10  # of the GP's NMSE
SI_TO_MM = float(2.0 * np.log(1000.0))  # NLPD of two lengths in mm less that in m
LEARNT = {"gp": "GP", "vhgp": "VHGP"}


def crossings_of(
    corpus: Corpus, found: Curves, sizes: Mapping[SplitName, tuple[int, ...]]
) -> Mapping[SplitName, Crossings]:
    """From where on GP and VHGP beat the analytical model, on each split."""

    def scores(kind: str, split: SplitName) -> list[list[PushScores]]:
        cells = [found.cells[corpus.reference, kind, split, n] for n in sizes[split]]
        return [[score.push_scores for score in cell] for cell in cells]

    return {
        split: {kind: crossing(sizes[split], scores(kind, split), scores("analytical", split)) for kind in LEARNT}
        for split in SPLITS
    }


def early(corpus: Corpus, where: Crossings) -> Finding:
    """Both learnt models beat the analytical one from about 100 windows."""
    told = "; ".join(f"{LEARNT[kind]} {at.text()}" for kind, at in where.items())
    sentence = (
        f"Training windows from which on the NMSE stays below the analytical model's: {told}; {SPLIT_WORDS['push']}, "
        f"{_set(corpus)}, interval by drawing pushes and folds anew. About {PAPER_SIZE} means up to {ABOUT}: holds if "
        "both intervals end there or before, does not hold if both begin after it, in part if one of the two ends in "
        "time."
    )
    return Finding(
        f"GP and VHGP beat the analytical model from about 100 samples ({corpus.name})", _in_time(where), sentence
    )


def in_the_end(corpus: Corpus, found: Curves, n: int) -> Finding:
    """Both learnt models have the smaller NMSE at the plan's size."""
    gaps = {kind: _gap(corpus, found, "analytical", kind, n) for kind in LEARNT}
    told = "; ".join(f"{LEARNT[kind]} {gap.text('.3f')}" for kind, gap in gaps.items())
    sentence = (
        f"NMSE less the analytical model's at n = {n}: {told} (paper: −0.34; −0.35); {_how(corpus, found, n)}. Holds "
        "if both intervals lie below 0, does not hold if both lie above, in part if one lies below."
    )
    return Finding(f"The learnt models predict better than the analytical one ({corpus.name})", _below(gaps), sentence)


def similar_mean(corpus: Corpus, found: Curves, n: int) -> Finding:
    """GP and VHGP show a similar NMSE."""
    scores = [found.push_scores(corpus.reference, kind, "push", n) for kind in LEARNT]
    value = total_nmse(scores[1].totals())[0] / total_nmse(scores[0].totals())[0]
    ratio = of_draws(value, total_nmse(scores[1].resampled()) / total_nmse(scores[0].resampled()))
    sentence = (
        f"NMSE of the VHGP over that of the GP at n = {n}: {ratio.text()} (paper: 0.97); {_how(corpus, found, n)}. "
        f"Similar means within {SIMILAR:.0%}: holds if the interval lies there, in part if only the figure does, does "
        "not hold if the interval lies outside."
    )
    return Finding(f"GP and VHGP have a similar NMSE ({corpus.name})", _alike(ratio), sentence)


def better_density(corpus: Corpus, found: Curves, n: int) -> Finding:
    """The VHGP has the smaller NLPD."""
    gp, vhgp = (found.push_scores(corpus.reference, kind, "push", n) for kind in LEARNT)
    gaussian, exact = (difference_by_push(gp, vhgp, figure) for figure in (total_nlpd, total_exact_nlpd))
    sentence = (
        f"NLPD of the VHGP less that of the GP at n = {n}: {gaussian.text()} nats, by its exact density {exact.text()} "
        f"(paper: −0.91); {_how(corpus, found, n)}. Holds if the first interval lies below 0, does not hold if it lies "
        "above, in part if only the exact density's lies below."
    )
    return Finding(f"The VHGP beats the GP in NLPD ({corpus.name})", _denser(gaussian, exact), sentence)


def _gap(corpus: Corpus, found: Curves, first: str, second: str, n: int) -> Estimate:
    baseline, model = (found.push_scores(corpus.reference, kind, "push", n) for kind in (first, second))
    return difference_by_push(baseline, model, total_nmse)


def _how(corpus: Corpus, found: Curves, n: int) -> str:
    pushes = len(found.push_scores(corpus.reference, "gp", "push", n).windows)
    return f"{SPLIT_WORDS['push']}, {pushes} pushes, {_set(corpus)}, interval by push"


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

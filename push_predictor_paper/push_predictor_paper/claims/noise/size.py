"""How large the noise is against what is expected, and how far it spans over the pushes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from push_predictor_paper.data.repetitions import RepeatedGrid
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.section import Finding, Table, Verdict
from push_predictor_paper.statistics.grid_maps import in_degrees
from push_predictor_paper.statistics.noise_figures import HIGH, LOW, Ratios, Span

WIDE = 1.0  # rad: beyond that the tip soon slides along the side
NAMES = ("dx", "dy", "rotation", "whole motion")
SOME, MOST = 10.0**0.5, 10.0**1.5  # spans of an order of magnitude
HALF, MOSTLY = 0.5, 0.8  # of the pushes


def size_finding(ratios: tuple[Ratios, ...], grid: RepeatedGrid) -> Finding:
    """ratios: of all pushes."""
    share = ratios[3].within
    overall = ", ".join(f"{name} {part.overall.text('.0%')}" for name, part in zip(NAMES, ratios, strict=True))
    return Finding(
        "The noise is 10 to 40 % of the expected output",
        sized([part.overall for part in ratios[:3]], share),
        f"Root mean square of the sd over that of the mean, {len(ratios[0].values)} pushes on {grid.surface}: "
        f"{overall}. Of the pushes {share.text('.0%')} have a noise of {LOW:.0%} to {HIGH:.0%} of the whole motion. "
        f"Rule, by intervals: holds if those of dx, dy and rotation lie within and that of the share above "
        f"{MOSTLY:.0%}; does not hold if all three lie outside and the share's below {HALF:.0%}; else in part if one "
        f"of the three lies within or the share's above {HALF:.0%}. The sizes are our simulator's.",
    )


def sized(overall: Sequence[Estimate], share: Estimate) -> Verdict:
    """overall: of dx, dy, rotation; share: of the pushes whose noise is of the paper's size."""
    inside = [part.low >= LOW and part.high <= HIGH for part in overall]
    outside = [part.high < LOW or part.low > HIGH for part in overall]
    if all(inside) and share.low >= MOSTLY:
        return "holds"
    if all(outside) and share.high < HALF:
        return "does not hold"
    return "holds in part" if any(inside) or share.low > HALF else "not decided"


def span_finding(reach: Mapping[str, tuple[Span, ...]], counts: Mapping[str, int]) -> Finding:
    """reach: of all pushes, and of those that are not steeply aslant."""

    def listed(which: str) -> str:
        return ", ".join(f"{name} {part.most.text('.1f')}" for name, part in zip(NAMES, reach[which], strict=False))

    return Finding(
        "The noise varies by up to an order of magnitude over the pushes",
        spanned([widest(reach[which]) for which in ("all", "near")]),
        f"95th over 5th percentile of the sd over {counts['all']} pushes: {listed('all')}; over the {counts['near']} "
        f"within {in_degrees(WIDE)}: {listed('near')}. Rule: an order of magnitude is what is nearer to ten than to "
        f"one or a hundred, {SOME:.1f} to {MOST:.0f}. Holds if over all pushes and over those within "
        f"{in_degrees(WIDE)} the interval of the widest of the three (the largest of their lower and of their upper "
        "ends) lies within, in part if over one of the two, does not hold if over both it lies outside. Beyond "
        f"{in_degrees(WIDE)} the slider hardly moves, so there the noise is small as a matter of course.",
    )


def widest(parts: Sequence[Span]) -> Estimate:
    """The largest span of several outputs: none of them is wider."""
    value, low, high = np.max([[p.most.value, p.most.low, p.most.high] for p in parts], axis=0).tolist()
    return Estimate(value, low, high)


def spanned(widest_of: Sequence[Estimate]) -> Verdict:
    """Of the widest spans over several sets of pushes."""
    within = [span.low >= SOME and span.high <= MOST for span in widest_of]
    if any(within):
        return "holds" if all(within) else "holds in part"
    return "does not hold" if all(span.high < SOME or span.low > MOST for span in widest_of) else "not decided"


def size_table(
    ratios: Mapping[str, tuple[Ratios, ...]], counts: Mapping[str, int], grid: RepeatedGrid, arm: float
) -> Table:
    """Quantiles, the share within the paper's range, the ratio of root mean squares; arm in m."""
    rows = [
        (
            f"{name}, {_which(which, counts)}",
            *(f"{q:.0%}" for q in part.quantiles),
            part.within.cell(".0%"),
            part.overall.cell(".0%"),
        )
        for which, parts in ratios.items()
        for name, part in zip(NAMES, parts, strict=True)
    ]
    head = ("sd over |mean|", "5 % of pushes below", "25 %", "median", "75 %", "95 %", "within 10 to 40 %", "RMS ratio")
    return Table(
        f"The noise against the expected output; simulated repetitions on {grid.surface}, first window of 0.2 s at "
        f"20 mm/s. Whole motion: rotation times {arm * 1e3:.1f} mm, the square's radius of gyration. RMS ratio: root "
        "mean square of the sd over that of the mean. Intervals draw blocks of neighbouring pushes anew. The paper: "
        "between 10 and 40 %, without saying of which pushes.",
        head,
        tuple(rows),
    )


def span_table(reach: Mapping[str, tuple[Span, ...]], counts: Mapping[str, int], grid: RepeatedGrid) -> Table:
    """Both spans."""
    rows = [
        (f"{name}, {_which(which, counts)}", part.most.cell(".1f"), part.extreme.cell(".1f"))
        for which, parts in reach.items()
        for name, part in zip(NAMES, parts, strict=False)
    ]
    return Table(
        f"The span of the sd over the pushes; simulated repetitions on {grid.surface}. Intervals draw repetitions "
        "anew; what the error of the sds adds to a span is taken off as far as they tell (basic bootstrap of the "
        "logarithm). The paper: up to an order of magnitude.",
        ("sd of", "95th over 5th percentile", "largest over smallest"),
        tuple(rows),
    )


def _which(which: str, counts: Mapping[str, int]) -> str:
    return f"{'all' if which == 'all' else f'within {in_degrees(WIDE)}:'} {counts[which]} pushes"


def ratio_json(parts: Sequence[Ratios]) -> dict[str, Any]:
    """By output."""
    return {
        name: {"quantiles": list(p.quantiles), "within_10_to_40": p.within.json(), "rms_ratio": p.overall.json()}
        for name, p in zip(NAMES, parts, strict=True)
    }


def span_json(parts: Sequence[Span]) -> dict[str, Any]:
    """By output."""

    def both(part: Span) -> dict[str, dict[str, float | None]]:
        return {"p95_over_p5": part.most.json(), "largest_over_smallest": part.extreme.json()}

    return {name: both(part) for name, part in zip(NAMES, parts, strict=False)}

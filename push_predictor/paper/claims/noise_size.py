"""How large the noise is against what is expected, and how far it spans over the pushes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from push_predictor.paper.noise_figures import HIGH, LOW, Ratios, Span
from push_predictor.paper.repetitions import RepeatedGrid
from push_predictor.paper.section import Finding, Table, Verdict

WIDE = 1.0  # rad: beyond that the tip soon slides along the side
NAMES = ("dx", "dy", "rotation", "whole motion")
MAGNITUDE, SOME = 10.0, 3.0  # spans
MOSTLY = 0.8  # of the pushes


def size_finding(ratios: tuple[Ratios, ...], grid: RepeatedGrid) -> Finding:
    """ratios: of all pushes."""
    inside = [part.overall.low >= LOW and part.overall.high <= HIGH for part in ratios[:3]]
    outside = [part.overall.high < LOW or part.overall.low > HIGH for part in ratios[:3]]
    share = ratios[3].within
    verdict: Verdict = "holds in part" if any(inside) or share.high > 0.5 else "not decided"
    if all(inside) and share.value >= MOSTLY:
        verdict = "holds"
    elif all(outside) and share.high < 0.5:
        verdict = "does not hold"
    overall = ", ".join(f"{name} {part.overall.text('.0%')}" for name, part in zip(NAMES, ratios, strict=True))
    return Finding(
        "The noise is 10 to 40 % of the expected output",
        verdict,
        f"Root mean square of the sd over that of the mean, {len(ratios[0].values)} pushes on {grid.surface}: "
        f"{overall}. Of the pushes {share.text('.0%')} have a noise of {LOW:.0%} to {HIGH:.0%} of the whole motion. "
        f"Rule: holds if the intervals of dx, dy and rotation lie within and {MOSTLY:.0%} of the pushes do; does not "
        "hold if all three lie outside and fewer than half of the pushes within; else in part. The sizes are our "
        "simulator's.",
    )


def span_finding(reach: Mapping[str, tuple[Span, ...]], counts: Mapping[str, int]) -> Finding:
    """reach: of all pushes, and of those that are not steeply aslant."""

    def told(which: str) -> str:
        return ", ".join(f"{name} {part.most.text('.1f')}" for name, part in zip(NAMES, reach[which], strict=False))

    large = [any(part.most.low >= MAGNITUDE for part in reach[which]) for which in ("all", "near")]
    small = all(part.most.high < SOME for part in reach["all"])
    verdict: Verdict = "holds" if all(large) else "does not hold" if small else "holds in part"
    return Finding(
        "The noise varies by up to an order of magnitude over the pushes",
        verdict,
        f"95th over 5th percentile of the sd over {counts['all']} pushes: {told('all')}; over the {counts['near']} "
        f"within {WIDE:g} rad: {told('near')}. Rule: holds if the interval of some output lies above {MAGNITUDE:g} "
        f"over all pushes and over those within {WIDE:g} rad, does not hold if all lie below {SOME:g}, else in part. "
        f"Beyond {WIDE:g} rad the slider hardly moves, so there the noise is small as a matter of course.",
    )


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
    return f"{'all' if which == 'all' else f'within {WIDE:g} rad:'} {counts[which]} pushes"


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

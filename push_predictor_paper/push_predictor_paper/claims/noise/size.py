# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The size of the noise relative to the mean outcome, and its range over the pushes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from push_predictor_paper.data.repetitions import RepeatedGrid
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.section import Finding, Table, Verdict
from push_predictor_paper.statistics.grid_maps import in_degrees
from push_predictor_paper.statistics.noise_figures import HIGH, LOW, Ratios, Span

WIDE = 1.0  # rad; beyond it the tip soon slides along the side
NAMES = ("dx", "dy", "rotation", "whole motion")
SOME, MOST = 10.0**0.5, 10.0**1.5  # ratios that count as an order of magnitude
HALF, MOSTLY = 0.5, 0.8  # of the pushes


def size_finding(ratios: tuple[Ratios, ...], grid: RepeatedGrid) -> Finding:
    """Is the noise 10 to 40 % of the mean outcome? ratios: of all pushes."""
    share = ratios[3].within
    overall = ", ".join(f"{name} {part.overall.text('.0%')}" for name, part in zip(NAMES, ratios, strict=True))
    return Finding(
        "The noise is 10 to 40 % of the expected output",
        sized([part.overall for part in ratios[:3]], share),
        f"Root mean square of the sd over that of the mean, {len(ratios[0].values)} pushes on {grid.surface}: "
        f"{overall}. {share.text('.0%')} of the pushes have a noise of {LOW:.0%} to {HIGH:.0%} of the whole motion. "
        f"Rule, by intervals: holds if those of dx, dy and rotation lie within that range and the share above "
        f"{MOSTLY:.0%}; does not hold if all three lie outside and the share below {HALF:.0%}; in part if one of the "
        f"three lies within, or the share above {HALF:.0%}. The size follows from our simulator's assumptions.",
        number=", ".join(f"{n} {part.overall.text('.0%')}" for n, part in zip(NAMES[:3], ratios[:3], strict=True)),
    )


def sized(overall: Sequence[Estimate], share: Estimate) -> Verdict:
    """Verdict. overall: ratios of dx, dy, rotation; share: of the pushes whose noise is of the paper's size."""
    inside = [part.low >= LOW and part.high <= HIGH for part in overall]
    outside = [part.high < LOW or part.low > HIGH for part in overall]
    if all(inside) and share.low >= MOSTLY:
        return "holds"
    if all(outside) and share.high < HALF:
        return "does not hold"
    return "holds in part" if any(inside) or share.low > HALF else "not decided"


def span_finding(reach: Mapping[str, tuple[Span, ...]], counts: Mapping[str, int]) -> Finding:
    """Does the noise vary by an order of magnitude? reach: of all pushes, and of those at moderate angles."""

    def listed(which: str) -> str:
        return ", ".join(f"{name} {part.most.text('.1f')}" for name, part in zip(NAMES, reach[which], strict=False))

    return Finding(
        "The noise varies by up to an order of magnitude over the pushes",
        spanned([widest(reach[which]) for which in ("all", "near")]),
        f"95th over 5th percentile of the sd: {listed('all')} over {counts['all']} pushes; {listed('near')} over the "
        f"{counts['near']} within {in_degrees(WIDE)}. Beyond {in_degrees(WIDE)} the slider hardly moves, so the "
        f"noise is small there. Rule: an order of magnitude means a ratio of {SOME:.1f} to {MOST:.0f}. Holds if the "
        f"interval of the widest output lies within, over all pushes and over those within {in_degrees(WIDE)}; in "
        "part if over one of the two; does not hold if it lies outside over both.",
        number=f"ratio {widest(reach['all']).text('.1f')}",
    )


def widest(parts: Sequence[Span]) -> Estimate:
    """The largest range of several outputs."""
    value, low, high = np.max([[p.most.value, p.most.low, p.most.high] for p in parts], axis=0).tolist()
    return Estimate(value, low, high)


def spanned(widest_of: Sequence[Estimate]) -> Verdict:
    """Verdict by the widest ranges over several sets of pushes."""
    within = [span.low >= SOME and span.high <= MOST for span in widest_of]
    if any(within):
        return "holds" if all(within) else "holds in part"
    return "does not hold" if all(span.high < SOME or span.low > MOST for span in widest_of) else "not decided"


def size_table(
    ratios: Mapping[str, tuple[Ratios, ...]], counts: Mapping[str, int], grid: RepeatedGrid, arm: float
) -> Table:
    """Quantiles, share within the paper's range and ratio of root mean squares; arm in m."""
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
        f"The noise relative to the mean outcome. Simulated repetitions on {grid.surface}, first window of 0.2 s at "
        f"20 mm/s. Whole motion: rotation times {arm * 1e3:.1f} mm, the square's radius of gyration. RMS ratio: root "
        "mean square of the sd over that of the mean. Intervals resample blocks of neighbouring pushes. The paper: "
        "between 10 and 40 %, without stating the pushes.",
        head,
        tuple(rows),
    )


def span_table(reach: Mapping[str, tuple[Span, ...]], counts: Mapping[str, int], grid: RepeatedGrid) -> Table:
    """Both ranges, by output."""
    rows = [
        (f"{name}, {_which(which, counts)}", part.most.cell(".1f"), part.extreme.cell(".1f"))
        for which, parts in reach.items()
        for name, part in zip(NAMES, parts, strict=False)
    ]
    return Table(
        f"The range of the sd over the pushes. Simulated repetitions on {grid.surface}. Intervals resample "
        "repetitions; a basic bootstrap of the logarithm removes most of the bias from errors of the sds. The "
        "paper: up to an order of magnitude.",
        ("sd of", "95th over 5th percentile", "largest over smallest"),
        tuple(rows),
    )


def _which(which: str, counts: Mapping[str, int]) -> str:
    return f"{'all' if which == 'all' else f'within {in_degrees(WIDE)}:'} {counts[which]} pushes"


def ratio_json(parts: Sequence[Ratios]) -> dict[str, Any]:
    """Ratios by output, for the JSON."""
    return {
        name: {"quantiles": list(p.quantiles), "within_10_to_40": p.within.json(), "rms_ratio": p.overall.json()}
        for name, p in zip(NAMES, parts, strict=True)
    }


def span_json(parts: Sequence[Span]) -> dict[str, Any]:
    """Ranges by output, for the JSON."""

    def both(part: Span) -> dict[str, dict[str, float | None]]:
        return {"p95_over_p5": part.most.json(), "largest_over_smallest": part.extreme.json()}

    return {name: both(part) for name, part in zip(NAMES, parts, strict=False)}

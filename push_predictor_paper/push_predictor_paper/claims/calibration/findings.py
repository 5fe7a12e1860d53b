# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Verdicts on coverage, PIT histograms and exact density, and their rules."""

from __future__ import annotations

from collections.abc import Sequence

from push_predictor.evaluation.metrics import COVERAGE_LEVELS
from push_predictor.recordings.table import OUTPUTS
from push_predictor_paper.claims.calibration.calibrated import EXACT, Calibrated
from push_predictor_paper.claims.corrected import corrected
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.fits.fit import SPLIT_WORDS, SPLITS
from push_predictor_paper.section import Finding, Origin, Verdict
from push_predictor_paper.statistics.pit import BARS

NAMES = {"GP": "GP", EXACT: "VHGP (exact predictive)"}
TOO_WIDE = 0.2  # a wider interval of a coverage decides nothing
FEWEST_PUSHES = 60  # with fewer, a test that does not reject decides nothing
TESTS = len(COVERAGE_LEVELS) * len(OUTPUTS)  # coverages tested together
UNEVEN = 0.05 / len(OUTPUTS)  # p below which one of the histograms is not flat
OURS: Origin = "beyond the paper"


def calibration_findings(found: Calibrated) -> tuple[Finding, ...]:
    """Findings about the coverage of GP and VHGP, and about shape and density of the VHGP."""
    intervals = (coverage_finding(found, model) for model in NAMES)
    return (*intervals, shape_finding(found), density_finding(found))


def coverage_finding(found: Calibrated, model: str) -> Finding:
    """Do a model's intervals cover as often as they should, output by output?"""
    coverages = found.coverages[model, "push"]
    states = [promise([level[k] for level in coverages]) for k in range(len(OUTPUTS))]
    listed = "; ".join(f"{name} {coverages[-1][k].text('.3f')}, {states[k]}" for k, name in enumerate(OUTPUTS))
    return Finding(
        f"The intervals of the {NAMES[model]} cover as often as they should ({found.name})",
        _all_of([s == "kept" for s in states], "open" in states and "broken" not in states),
        f"Coverage of the 95 % intervals: {listed}. Furthest from its level: {_furthest(coverages)}. "
        f"{found.windows('push')}, {SPLIT_WORDS['push']}. Rule: an output is `kept` if its coverages at 50, 90 and "
        f"95 % all have intervals that contain the level. Each interval is widened for {TESTS} tests (Bonferroni). "
        f"An output is `open` if so, but a 95 % interval is wider than {TOO_WIDE}; else `broken`. The claim holds if "
        "all three are kept, in part if some are.",
        OURS,
        number=f"95 % intervals: {_least_covered(coverages)}",
    )


def shape_finding(found: Calibrated) -> Finding:
    """Does the exact predictive distribution have the right shape?"""
    shape = found.shapes[EXACT, "push"]
    flat = [not p <= UNEVEN for p in shape.p.tolist()]
    listed = "; ".join(f"{n} {m:.1%}, p = {p:.3f}" for n, m, p in zip(OUTPUTS, shape.misplaced, shape.p, strict=True))
    few = len(found.judged["vhgp", "push"].push_scores.push_id) < FEWEST_PUSHES
    return Finding(
        f"The VHGP's exact predictive distribution has the right shape ({found.name})",
        _all_of(flat, all(flat) and few),
        f"Share of windows in the wrong one of {BARS} bars of the PIT histogram, and p if the true one is flat: "
        f"{listed}. {found.windows('push')}, {SPLIT_WORDS['push']}. Rule: an output agrees if p > {UNEVEN:.3f} (0.05 "
        f"over {len(OUTPUTS)} outputs). The claim holds if all agree, in part if some do. Agreement of fewer than "
        f"{FEWEST_PUSHES} pushes decides nothing.",
        OURS,
        number=f"{sum(flat)} of {len(flat)} outputs agree",
    )


def density_finding(found: Calibrated) -> Finding:
    """Is the exact density better than the Gaussian of the same mean and variance?"""
    gains = found.gains
    better = [gains[split].high < 0.0 for split in SPLITS]
    return Finding(
        f"The VHGP's exact predictive density is better than the Gaussian of its mean and variance ({found.name})",
        _all_of(better, not any(better) and not gains["push"].low > 0.0),
        f"Exact minus Gaussian NLPD, sum of the outputs: {gains['push'].text('+.3f')} nats with {SPLIT_WORDS['push']} "
        f"({found.windows('push')}), {gains['random'].text('+.3f')} on the {SPLIT_WORDS['random']}. Below zero is "
        "better. Rule: holds if the 95 % interval by push is below zero on both splits, in part if on one.",
        OURS,
        number=f"{gains['push'].text('+.3f')} nats",
    )


def _least_covered(coverages: Sequence[Sequence[Estimate]]) -> str:
    """The output whose 95 % intervals cover least; coverages: by level, then by output."""
    name, least = min(zip(OUTPUTS, coverages[-1], strict=True), key=lambda pair: pair[1].value)
    return f"{name} {least.text('.3f')}"


def promise(coverages: Sequence[Estimate]) -> str:
    """State of one output, from its coverages by level: kept, broken or open. Corrected for all outputs."""
    pairs = [(corrected(e, TESTS), level) for e, level in zip(coverages, COVERAGE_LEVELS, strict=True)]
    if any(e.low > level or e.high < level for e, level in pairs):
        return "broken"
    return "kept" if all(e.high - e.low <= TOO_WIDE for e in coverages) else "open"


def _furthest(coverages: Sequence[Sequence[Estimate]]) -> str:
    """The coverage [level][output] furthest from its level, in words."""
    cells = [
        (abs(estimate.value - level), f"{estimate.text('.3f')} of {name} for {level:.2f}")
        for level, estimates in zip(COVERAGE_LEVELS, coverages, strict=True)
        for name, estimate in zip(OUTPUTS, estimates, strict=True)
    ]
    return max(cells)[1]


def _all_of(good: Sequence[bool], undecided: bool) -> Verdict:
    if undecided:
        return "not decided"
    return "holds" if all(good) else "holds in part" if any(good) else "does not hold"

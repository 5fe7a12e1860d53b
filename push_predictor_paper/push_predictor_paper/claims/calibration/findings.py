"""What coverage, PIT histograms and exact density say, and by which rule."""

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
TOO_WIDE = 0.2  # an interval of a coverage that wide decides nothing
FEWEST_PUSHES = 60  # for calling a histogram flat because nothing speaks against it
TESTS = len(COVERAGE_LEVELS) * len(OUTPUTS)  # intervals that must all hold their level
UNEVEN = 0.05 / len(OUTPUTS)  # p below which one of the histograms is not flat
OURS: Origin = "beyond the paper"


def calibration_findings(found: Calibrated) -> tuple[Finding, ...]:
    """Coverage of the GP and of the VHGP, shape and density of the VHGP."""
    intervals = (coverage_finding(found, model) for model in NAMES)
    return (*intervals, shape_finding(found), density_finding(found))


def coverage_finding(found: Calibrated, model: str) -> Finding:
    """Whether a model's intervals hold what they promise, by output."""
    coverages = found.coverages[model, "push"]
    states = [promise([level[k] for level in coverages]) for k in range(len(OUTPUTS))]
    told = "; ".join(f"{name} {coverages[-1][k].text('.3f')}, {states[k]}" for k, name in enumerate(OUTPUTS))
    return Finding(
        f"The intervals of the {NAMES[model]} hold as many outcomes as they promise ({found.name})",
        _all_of([s == "kept" for s in states], "open" in states and "broken" not in states),
        f"Inside the 95 % intervals: {told}; furthest from its level: {_furthest(coverages)}. "
        f"{found.windows('push')}, {SPLIT_WORDS['push']}. An output is `kept` if the intervals of its coverages at 50, "
        f"90 and 95 % all contain that level, each widened for the {TESTS} levels and outputs that are asked together "
        "(Bonferroni, so that a right model is kept whole in 95 % of such sets), `open` if they do and one of the 95 % "
        f"intervals is wider than {TOO_WIDE}, else `broken`. The claim holds if all three are kept, in part if some "
        "are.",
        OURS,
    )


def shape_finding(found: Calibrated) -> Finding:
    """Whether the exact predictive has the right shape."""
    shape = found.shapes[EXACT, "push"]
    flat = [not p <= UNEVEN for p in shape.p.tolist()]
    told = "; ".join(f"{n} {m:.1%}, p = {p:.3f}" for n, m, p in zip(OUTPUTS, shape.misplaced, shape.p, strict=True))
    few = len(found.judged["vhgp", "push"].push_scores.push_id) < FEWEST_PUSHES
    return Finding(
        f"Outcomes are spread over the VHGP's exact predictive distribution as it says ({found.name})",
        _all_of(flat, all(flat) and few),
        f"Share of the windows in the wrong one of {BARS} bars of the PIT histogram, and how often drawing pushes "
        f"alone gives that much: {told}. {found.windows('push')}, {SPLIT_WORDS['push']}. An output agrees if p > "
        f"{UNEVEN:.3f} (0.05 over the {len(OUTPUTS)} outputs); the claim holds if all do, in part if some do; below "
        f"{FEWEST_PUSHES} pushes that decides nothing.",
        OURS,
    )


def density_finding(found: Calibrated) -> Finding:
    """Whether the exact density is better than the Gaussian of the same mean and variance."""
    gains = found.gains
    better = [gains[split].high < 0.0 for split in SPLITS]
    return Finding(
        f"The VHGP's exact predictive density tells more than the Gaussian of its mean and variance ({found.name})",
        _all_of(better, not any(better) and not gains["push"].low > 0.0),
        f"Exact less Gaussian NLPD, sum of the outputs: {gains['push'].text('+.3f')} nats with {SPLIT_WORDS['push']} "
        f"({found.windows('push')}), {gains['random'].text('+.3f')} on the {SPLIT_WORDS['random']}; below zero is "
        "better. The claim holds if the 95 % interval by push is below zero on both splits, in part if on one.",
        OURS,
    )


def promise(coverages: Sequence[Estimate]) -> str:
    """Of one output, its coverages by level: kept, broken or open; its intervals are corrected for all outputs."""
    pairs = [(corrected(e, TESTS), level) for e, level in zip(coverages, COVERAGE_LEVELS, strict=True)]
    if any(e.low > level or e.high < level for e, level in pairs):
        return "broken"
    return "kept" if all(e.high - e.low <= TOO_WIDE for e in coverages) else "open"


def _furthest(coverages: Sequence[Sequence[Estimate]]) -> str:
    """The coverage [level][output] that is most wrong, in words."""
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

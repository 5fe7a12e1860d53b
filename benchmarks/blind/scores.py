# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How often the residual loop was right, with 95 % Wilson intervals, next to the targets."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from benchmarks.blind.judge import SIZES, Judged, judge

Z95 = 1.959964
UNCHANGED = ("none", "wrench", "measurement")  # channels that leave the motion model alone
FOUND = ("", "at least 92 %", "at least 97 %")  # targets for small, medium and large effects


@dataclass(frozen=True)
class Rate:
    """A count of a total, its 95 % Wilson interval (low, high), and the target in words, empty without one."""

    what: str
    count: int
    of: int
    low: float
    high: float
    target: str = ""


def score_of(truths: Mapping[str, Mapping[str, Any]], results: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Score verdicts (the JSON of trace) by the name of their recording; truths without a verdict are skipped."""
    judged = {name: judge(truths[name], results[name]) for name in truths if name in results}
    return {
        "recordings": len(judged),
        "without": sorted({str(results[name].get("without")) for name in judged}),
        "rates": [asdict(rate) for rate in rates(list(judged.values()))],
        "numbers": numbers(list(judged.values())),
        "judged": {name: asdict(one) for name, one in judged.items()},
    }


def rates(judged: Sequence[Judged]) -> list[Rate]:
    """The table's rates, in its order."""
    groups = {name: [j for j in judged if j.group == name] for name in ("none", "input_shift")}
    still = [j for j in judged if j.channel in UNCHANGED]
    real = _found([j for j in judged if j.channel != "none"])
    compared = [j for j in judged if j.covered is not None]
    gained = [j for j in judged if j.share is not None]
    return [
        rate("false alarms on recordings without an effect", groups["none"], lambda j: j.found, "at most 1 in 30"),
        rate("motion model changed without cause", still, lambda j: j.changed, "none"),
        rate("input shift reported", groups["input_shift"], lambda j: j.shift, "100 %"),
        rate("input shift taken for an effect", groups["input_shift"], lambda j: j.found),
        *_motion(judged),
        *_other_channels(judged),
        rate("interval of the parameter covers the true value", compared, lambda j: bool(j.covered), "85 to 98 %"),
        rate("superfluous further effects", real, lambda j: j.superfluous > 0, "at most 5 %"),
        rate("gain at least 0.9 of the oracle's, medium and large", gained, lambda j: (j.share or 0.0) >= 0.9),
        rate("harm: extended, interval of the gain wholly above zero", judged, lambda j: j.harm, "none"),
        rate("extension refused, interval of the gain wholly above zero", judged, lambda j: j.worse and not j.harm),
        rate("traces that failed", judged, lambda j: j.failed, "none"),
    ]


def _motion(judged: Sequence[Judged]) -> list[Rate]:
    """Effects on the motion, by mechanism in the library or not."""
    motion = [j for j in judged if j.channel == "motion"]
    inside, outside = ([j for j in motion if j.outside == side] for side in (False, True))
    return [
        *_by_size("found, mechanism in the library", inside, lambda j: j.found, FOUND),
        *_by_size("right mechanism and driver first", _found(inside), lambda j: j.name and j.driver),
        rate("right mechanism first, all sizes", _found(inside), lambda j: j.name, "at least 95 %"),
        rate("right driver first, all sizes", _found(inside), lambda j: j.driver),
        rate("right driver in the named set", _decidable(inside), lambda j: j.in_set, "at least 95 %"),
        rate("right driver in the named set, all sizes", _found(inside), lambda j: j.in_set),
        rate("of two effects, both named", _found([j for j in inside if j.two]), lambda j: j.both),
        *_by_size("found, mechanism not in the library", outside, lambda j: j.found, FOUND),
        rate("of these reported as unknown", _found(outside), lambda j: j.unknown),
        rate("given a wrong name, mechanism not in the library", outside, lambda j: j.wrong, "none of 20"),
        rate(
            "right driver in the named set, not in the library",
            _decidable(outside),
            lambda j: j.in_set,
            "at least 95 %",
        ),
    ]


def _other_channels(judged: Sequence[Judged]) -> list[Rate]:
    wrench, measured, variance = ([j for j in judged if j.channel == c] for c in ("wrench", "measurement", "variance"))
    return [
        rate("wrench-only changes reported as such", wrench, lambda j: j.verdict == "wrench_only"),
        *_by_size("measurement errors reported as such", measured, lambda j: j.found),
        rate("right measurement error named", _found(measured), lambda j: j.name),
        *_by_size("variance effects found as such", variance, lambda j: j.found and j.name),
    ]


def numbers(judged: Sequence[Judged]) -> dict[str, float | None]:
    """Mean size of the named set, median share of the oracle's gain, seconds of processor time."""
    shares = [j.share for j in judged if j.share is not None]
    sets = [j.set_size for j in judged if j.set_size and j.channel == "motion"]
    seconds = [j.seconds for j in judged if j.seconds is not None]
    return {
        "mean size of the named set (target at most 2)": float(np.mean(sets)) if sets else None,
        "median share of the oracle's NLPD gain, medium and large (target at least 0.9)": _median(shares),
        "median seconds of a trace (target at most 20)": _median(seconds),
        "longest trace, seconds (target at most 60)": max(seconds, default=None),
    }


def markdown_of(scored: Mapping[str, Any]) -> str:
    """The score as a Markdown table for the documentation."""
    lines = ["| what | rate | 95 % interval | target |", "| --- | --- | --- | --- |"]
    for r in scored["rates"]:
        interval = f"{100 * r['low']:.0f} to {100 * r['high']:.0f} %" if r["of"] else "no such recording"
        lines.append(f"| {r['what']} | {r['count']} of {r['of']} | {interval} | {r['target']} |")
    for what, value in scored["numbers"].items():
        lines.append(f"| {what} | {'none' if value is None else f'{value:.2f}'} | | |")
    return "\n".join(lines) + "\n"


def rate(what: str, of: Iterable[Judged], holds: Callable[[Judged], bool], target: str = "") -> Rate:
    """The rate at which a condition is true."""
    among = list(of)
    count = sum(map(holds, among))
    return Rate(what, count, len(among), *wilson(count, len(among)), target)


def wilson(count: int, of: int) -> tuple[float, float]:
    """The 95 % interval of a share (Wilson 1927); 0 to 1 for an empty total."""
    if not of:
        return 0.0, 1.0
    share, square = count / of, Z95**2
    centre = (share + square / (2 * of)) / (1 + square / of)
    half = Z95 * float(np.sqrt(share * (1 - share) / of + square / (4 * of**2))) / (1 + square / of)
    return max(0.0, centre - half), min(1.0, centre + half)


def _by_size(
    what: str, among: Sequence[Judged], holds: Callable[[Judged], bool], targets: Sequence[str] = ("", "", "")
) -> Iterable[Rate]:
    for size, target in zip(SIZES, targets, strict=True):
        yield rate(f"{what}: {size}", [j for j in among if j.size == size], holds, target)


def _found(judged: Sequence[Judged]) -> list[Judged]:
    return [j for j in judged if j.found]


def _decidable(judged: Sequence[Judged]) -> list[Judged]:
    return [j for j in _found(judged) if j.decidable]


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None

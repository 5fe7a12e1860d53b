"""How often the residual loop was right, with 95 % Wilson intervals, next to the targets."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

Z95 = 1.959964
MEDIUM, LARGE = 0.1, 0.4  # nats gained by the oracle: below the first small, above the second large
UNCHANGED = ("none", "wrench", "measurement")  # channels that leave the motion model alone
SIZES = ("small", "medium", "large")


@dataclass(frozen=True)
class Judged:
    """The score of one recording.

    size: by the oracle's gain if known, else as drawn. name, driver: whether the first one is right. unknown: whether
    the mechanism was reported as outside the library. wrong: whether a wrong mechanism was named. in_set, set_size: of
    the drivers that fit equally well; 0 if none was named. share: of the oracle's gain.
    """

    group: str
    channel: str
    kind: str
    size: str
    outside: bool
    verdict: str
    found: bool
    changed: bool
    name: bool
    driver: bool
    unknown: bool
    wrong: bool
    in_set: bool
    set_size: int
    share: float | None
    harm: bool
    seconds: float
    failed: bool


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


def judge(truth: Mapping[str, Any], result: Mapping[str, Any]) -> Judged:
    """Score one verdict. A mechanism that the run removed counts as outside the library."""
    failed = "failed" in result
    names = [None if name is not None and name == result.get("without") else name for name in truth["names"]]
    effects = [] if failed else result["effects"]
    mechanism = effects[0]["mechanism"] if effects else None
    driver = _first_driver(result)
    accepted, named = set(truth["covariates"]), {driver, *result.get("equivalent", ())} - {None}
    channel = "none" if failed else result["channel"]
    found = channel == ("motion" if truth["channel"] == "variance" else truth["channel"]) and channel != "none"
    if truth["channel"] == "none":
        found = not failed and bool(result["effect_present"])
    low = None if failed else result["gain"]["nlpd"]["low"]
    return Judged(
        group=truth["group"],
        channel=truth["channel"],
        kind=truth["kind"],
        size=_size(truth),
        outside=None in names,
        verdict="failed" if failed else result["verdict"],
        found=found,
        changed=not failed and bool(result["motion_model_changed"]),
        name=found and (mechanism in names if names else result.get("kind") == "variance"),
        driver=found and (driver in accepted or _undriven(truth, mechanism, names)),
        unknown=found and mechanism is None and bool(effects),
        wrong=bool(names) and mechanism is not None and mechanism not in names,
        in_set=found and (bool(accepted & named) or _undriven(truth, mechanism, names)),
        set_size=len(named) if found else 0,
        share=_share(truth, result, failed),
        harm=low is not None and low > 0.0,
        seconds=float(result.get("seconds", 0.0)),
        failed=failed,
    )


def rates(judged: Sequence[Judged]) -> list[Rate]:
    """The table's rates, in its order."""
    none = [j for j in judged if j.channel == "none"]
    still = [j for j in judged if j.channel in UNCHANGED]
    wrench = [j for j in judged if j.channel == "wrench"]
    motion = [j for j in judged if j.channel == "motion"]
    inside, outside = ([j for j in motion if j.outside == side] for side in (False, True))
    measured = [j for j in judged if j.channel == "measurement"]
    variance = [j for j in judged if j.channel == "variance"]
    return [
        rate("false alarms on recordings without an effect", none, lambda j: j.found, "at most 2 in 30"),
        rate("motion model changed without cause", still, lambda j: j.changed, "none"),
        rate("wrench-only changes reported as such", wrench, lambda j: j.verdict == "wrench_only"),
        *_by_size("found, mechanism in the library", inside, lambda j: j.found, ("", "90 %", "95 %")),
        *_by_size("right mechanism and driver first", _found(inside), _right_first, ("", "90 %", "90 %")),
        rate("right mechanism first, all sizes", _found(inside), lambda j: j.name, "90 %"),
        rate("right driver first, all sizes", _found(inside), lambda j: j.driver),
        rate("right driver in the named set", _found(inside), lambda j: j.in_set, "97 %"),
        *_by_size("found, mechanism not in the library", outside, lambda j: j.found, ("", "90 %", "95 %")),
        rate("of these reported as unknown", _found(outside), lambda j: j.unknown),
        rate("given a wrong name, mechanism not in the library", outside, lambda j: j.wrong, "none"),
        rate("right driver in the named set, not in the library", _found(outside), lambda j: j.in_set, "97 %"),
        *_by_size("measurement errors reported as such", measured, lambda j: j.found, ("", "", "")),
        rate("right measurement error named", _found(measured), lambda j: j.name),
        *_by_size("variance effects found as such", variance, lambda j: j.found and j.name, ("", "", "")),
        rate("harm: interval of the gain wholly above zero", judged, lambda j: j.harm, "none"),
        rate("traces that failed", judged, lambda j: j.failed, "none"),
    ]  # fmt: skip


def numbers(judged: Sequence[Judged]) -> dict[str, float | None]:
    """Mean size of the named set, median share of the oracle's gain, seconds of processor time."""
    shares = [j.share for j in judged if j.share is not None]
    sets = [j.set_size for j in judged if j.set_size and j.channel == "motion"]
    seconds = [j.seconds for j in judged]
    return {
        "mean size of the named set (target at most 2)": float(np.mean(sets)) if sets else None,
        "median share of the oracle's NLPD gain, medium and large (target 0.8)": _median(shares),
        "median seconds of a trace": _median(seconds),
        "longest trace, seconds (target 120)": max(seconds, default=None),
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
    what: str, among: Sequence[Judged], holds: Callable[[Judged], bool], targets: Sequence[str]
) -> Iterable[Rate]:
    for size, target in zip(SIZES, targets, strict=True):
        yield rate(f"{what}: {size}", [j for j in among if j.size == size], holds, target)


def _right_first(judged: Judged) -> bool:
    return judged.name and judged.driver


def _found(judged: Sequence[Judged]) -> list[Judged]:
    return [j for j in judged if j.found]


def _first_driver(result: Mapping[str, Any]) -> str | None:
    return result["covariates"][0] if result.get("covariates") else None


def _undriven(truth: Mapping[str, Any], mechanism: str | None, names: Sequence[str | None]) -> bool:
    """Whether the right measurement error was named; it has no driver that could be wrong."""
    return truth["channel"] == "measurement" and mechanism in names


def _size(truth: Mapping[str, Any]) -> str:
    gain = truth.get("oracle_gain")
    if gain is None:
        return str(truth["size"])
    return SIZES[int(-gain["value"] >= MEDIUM) + int(-gain["value"] > LARGE)]


def _share(truth: Mapping[str, Any], result: Mapping[str, Any], failed: bool) -> float | None:
    """Share of the oracle's gain if that is at least MEDIUM; an unchanged model gains nothing."""
    oracle = truth.get("oracle_gain")
    if oracle is None or -oracle["value"] < MEDIUM:
        return None
    if failed or not result["motion_model_changed"]:
        return 0.0
    return float(result["gain"]["nlpd"]["value"] / oracle["value"])


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None

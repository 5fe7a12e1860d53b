# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The score of one recording: what a trace reported, next to what was hidden."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.blind.true_parameter import covers

MEDIUM, LARGE = 0.1, 0.4  # nats gained by the oracle: below the first small, above the second large
SIZES = ("small", "medium", "large")
SINCE_TRAINING = {"session", "model_inputs"}  # a constant difference from training: either name is right

Json = Mapping[str, Any]


@dataclass(frozen=True)
class Judged:
    """The score of one recording.

    size: by the oracle's gain if known, else as drawn. decidable: whether the data determine the driver; false for a
    small effect if the interval of the oracle's gain contains zero. two: whether two effects act. name, driver: whether
    the first reported one is right; with two, that of either. both: whether both of two mechanisms were reported.
    unknown: whether the mechanism was reported as outside the library. wrong: whether a wrong mechanism was named
    first. superfluous: number of further effects that do not act. in_set, set_size: of the drivers that fit equally
    well; 0 if none was named. covered: whether the interval of the first effect's parameter covers the true value, None
    if they are not compared. shift: whether shifted inputs were reported. share: of the oracle's gain. worse: whether
    the interval of the reported gain lies wholly above zero. harm: whether a model was extended although it is worse.
    seconds: of processor time, if known.
    """

    group: str
    channel: str
    kind: str
    size: str
    decidable: bool
    two: bool
    outside: bool
    verdict: str
    found: bool
    changed: bool
    name: bool
    both: bool
    driver: bool
    unknown: bool
    wrong: bool
    superfluous: int
    in_set: bool
    set_size: int
    covered: bool | None
    shift: bool
    share: float | None
    worse: bool
    harm: bool
    seconds: float | None
    failed: bool


@dataclass(frozen=True)
class Acting:
    """An effect that acts: its record in the truth, the right names and the right covariates."""

    record: Json
    names: tuple[str | None, ...]
    covariates: frozenset[str]


def judge(truth: Json, result: Json) -> Judged:
    """Score one verdict. A mechanism that the run removed counts as outside the library."""
    failed = "failed" in result
    acting = acting_effects(truth, result.get("without"))
    effects = [] if failed else distinct(_reported(truth, result))
    mechanism = effects[0]["mechanism"] if effects else None
    named = _matching(acting, mechanism) if effects else None
    driver = _first_driver(result)
    drivers = {driver, *result.get("equivalent", ())} - {None}
    accepted = {name for one in ([named] if named else acting) for name in one.covariates}
    undriven = truth["channel"] == "measurement" and named is not None  # it has no driver that could be wrong
    found = not failed and _found(truth, result)
    changed = not failed and bool(result["motion_model_changed"])
    worse = not failed and bool(result["gain"]["nlpd"]["low"] > 0.0)
    missed, superfluous = missed_and_superfluous(effects, acting)
    return Judged(
        group=truth["group"],
        channel=truth["channel"],
        kind=truth["kind"],
        size=_size(truth),
        decidable=_decidable(truth),
        two=len(acting) > 1,
        outside=None in acting[0].names and truth["channel"] == "motion",
        verdict="failed" if failed else result["verdict"],
        found=found,
        changed=changed,
        name=found and (named is not None if truth["names"] else result.get("kind") == "variance"),
        both=found and len(acting) > 1 and not missed,
        driver=found and (driver in accepted or undriven),
        unknown=found and mechanism is None and bool(effects),
        wrong=bool(truth["names"]) and mechanism is not None and named is None,
        superfluous=superfluous if found else 0,
        in_set=found and (bool(accepted & drivers) or undriven),
        set_size=len(drivers) if found else 0,
        covered=covers(truth, named.record, effects[0]) if found and named and effects else None,
        shift=not failed and bool(result.get("input_shift")),
        share=_share(truth, result, failed),
        worse=worse,
        harm=changed and worse,  # nobody uses an extension that was refused
        seconds=result.get("seconds"),
        failed=failed,
    )


def acting_effects(truth: Json, without: str | None = None) -> list[Acting]:
    """The effect of a truth and its second one, without a name that the run removed from the library."""
    found = []
    for record in filter(None, (truth, truth.get("second"))):
        names = tuple(None if name is not None and name == without else name for name in record["names"])
        right = frozenset(record["covariates"])
        # Noise has no mechanism: it is reported without a name.
        found.append(Acting(record, names or (None,), right | SINCE_TRAINING if right & SINCE_TRAINING else right))
    return found


def distinct(effects: Sequence[Json]) -> list[Json]:
    """The reported effects; one for each component of a vector counts once."""
    first: dict[tuple[str | None, str], Json] = {}
    for each in effects:
        first.setdefault((each["mechanism"], each["covariate"]), each)
    return list(first.values())


def missed_and_superfluous(effects: Sequence[Json], acting: Sequence[Acting]) -> tuple[int, int]:
    """Numbers of acting effects that no reported one matches, and of further reported ones that match none.

    Each acting effect matches once. The first reported effect is never superfluous: it is right or wrong.
    """
    remaining, count = list(acting), 0
    for place, effect in enumerate(effects):
        match = _matching(remaining, effect["mechanism"])
        if match:
            remaining.remove(match)
        elif place > 0:
            count += 1
    return len(remaining), count


def _matching(acting: Sequence[Acting], mechanism: str | None) -> Acting | None:
    return next((one for one in acting if mechanism in one.names), None)


def _found(truth: Json, result: Json) -> bool:
    """Whether the right channel was reported; without an effect: whether any was."""
    if truth["group"] == "input_shift":
        return result["verdict"] not in ("none", "input_shift")
    if truth["channel"] == "none":
        return bool(result["effect_present"])
    if _harmless(truth, result):
        return True
    return bool(result["channel"] == ("motion" if truth["channel"] == "variance" else truth["channel"]))


def _reported(truth: Json, result: Json) -> Sequence[Json]:
    """The reported effects; a hidden error of measurement that was reported as harmless, with nothing else, counts."""
    return result["effects"] or [{**each, "covariate": "model_inputs"} for each in _harmless(truth, result)]


def _harmless(truth: Json, result: Json) -> list[Json]:
    """What was reported as harmless of a hidden error of measurement, and nothing else."""
    if truth["channel"] != "measurement" or result["effect_present"]:
        return []
    return [each for each in result.get("harmless", ()) if each["mechanism"] in truth["names"]]


def _first_driver(result: Json) -> str | None:
    return result["covariates"][0] if result.get("covariates") else None


def _size(truth: Json) -> str:
    gain = truth.get("oracle_gain")
    if gain is None:
        return str(truth["size"])
    return SIZES[int(-gain["value"] >= MEDIUM) + int(-gain["value"] > LARGE)]


def _decidable(truth: Json) -> bool:
    high = (truth.get("oracle_gain") or {}).get("high")
    return _size(truth) != "small" or high is None or high < 0.0


def _share(truth: Json, result: Json, failed: bool) -> float | None:
    """Share of the oracle's gain; None if that is below MEDIUM over the refit, or if it would not extend the model.

    Both gains are over the better of the deployed model and the refit. An unchanged model gains nothing.
    """
    oracle = truth.get("oracle_gain")
    if oracle is None or -oracle["value"] < MEDIUM or oracle["traced"]["high"] >= 0.0:
        return None
    if failed or not result["motion_model_changed"]:
        return 0.0
    return float(result["gain"]["nlpd"]["value"] / oracle["traced"]["value"])

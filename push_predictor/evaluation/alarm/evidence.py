# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""An alarm that can be checked after every push: without a change it fires with probability at most `rate`.

Each push gives several scores. If it is exchangeable with the calibration pushes, the rank of a new score among all
scores so far, with ties broken at random, gives p values that are independent and uniform (Vovk, Gammerman and Shafer
2005, section 7.1: conformal transducers). Each score bets that these p values are too often near 0 (or near 1). The
capital is a test martingale, a mixture over the bets and over the push at which the change began. The weighted union
over the scores is valid for any dependence between them:

    P(max over scores of weight * martingale ever reaches 1 / rate) <= sum of weights * rate = rate    (Ville)
"""

from __future__ import annotations

import json
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.types import Array

DEFAULT_RATE = 0.01
POWERS = (0.2, 0.4, 0.6, 0.8)  # exponents e of the bets e p^(e - 1)
PATIENCE = 50.0  # pushes; prior of the change: P(not begun by push t) = (1 + t / PATIENCE)^-1/2
SMALLEST = 1e-12  # p value; smaller ones are rounding errors
SIZE = "size of the residual"  # name of the score that measures how large the errors are
_LOG_POWERS, _BENDS, _LOG_10 = np.log(POWERS), np.array(POWERS) - 1.0, np.log(10.0)
MOST_KEPT = 20_000  # scores of each kind that are ranked; beyond that the oldest new ones are dropped


@dataclass(frozen=True)
class ScoreKind:
    """Name of a score, its share of the false alarms (they sum to one), and whether low values count too."""

    name: str
    weight: float
    two_sided: bool


@dataclass(frozen=True)
class AlarmState:
    """The state of an alarm.

    log10_evidence: current evidence, the alarm fires at `threshold`; strongest: the score with this evidence.
    fired_at: the push at which it fired (None: not yet); fired_after: number of pushes until then; fired_evidence,
    fired_by: evidence and score at that push.
    """

    false_alarm_rate: float
    threshold: float
    pushes: int
    log10_evidence: float
    strongest: str
    calibration_pushes: int
    fired_at: str | None = None
    fired_after: int | None = None
    fired_evidence: float | None = None
    fired_by: str | None = None

    @property
    def fired(self) -> bool:
        """Whether the alarm has fired."""
        return self.fired_at is not None


class Alarm:
    """A sequential test on the scores of pushes. It fires at most once until it is reset.

    kinds: the k scores of a push. calibration (n, k): scores of pushes that the model fits. seed: for random ties.
    Raises RequestError for a rate outside (0, 1) and for scores that are not finite.
    """

    def __init__(
        self, kinds: Sequence[ScoreKind], calibration: Array, rate: float = DEFAULT_RATE, seed: int = 0
    ) -> None:
        self.rate = checked_rate(rate)
        self.kinds = tuple(kinds)
        for row in calibration:
            self._check(row)
        self._calibration, self._seed = np.asarray(calibration, dtype=np.float64), seed
        self.reset()

    def reset(self) -> None:
        """Forget all pushes except the calibration, so that the alarm can fire again."""
        self._rng = np.random.default_rng(self._seed)
        self._rank = [_Ranking(column) for column in self._calibration.T]
        self._bets = [_Bets(kind.two_sided) for kind in self.kinds]
        self._pushes = 0
        self._fired: tuple[str, int, float, str] | None = None

    def add(self, push_id: str, scores: Array) -> bool:
        """Add the scores (k,) of a push; return whether the alarm fires at this push."""
        self._check(scores)
        chance = 1.0 - self._rng.random(len(self.kinds))
        for ranking, bets, score, u in zip(self._rank, self._bets, scores.tolist(), chance.tolist(), strict=True):
            bets.add(ranking.p_value(score, u))
        self._pushes += 1
        evidence, strongest = self._evidence()
        if self._fired is not None or evidence < self.threshold:
            return False
        self._fired = (push_id, self._pushes, evidence, strongest)
        return True

    @property
    def threshold(self) -> float:
        """Log10 of the evidence at which the alarm fires."""
        return float(-np.log10(self.rate))

    @property
    def state(self) -> AlarmState:
        """The state after all pushes so far."""
        seen = (self.rate, self.threshold, self._pushes, *self._evidence(), len(self._calibration))
        return AlarmState(*seen, *(self._fired or ()))

    def _evidence(self) -> tuple[float, str]:
        each = [np.log10(kind.weight) + bets.log10 for kind, bets in zip(self.kinds, self._bets, strict=True)]
        best = int(np.argmax(each))
        return float(each[best]), self.kinds[best].name

    def _check(self, scores: Array) -> None:
        for kind, score in zip(self.kinds, scores, strict=True):
            if not np.isfinite(score):
                raise RequestError(f"score {kind.name}", float(score), "a finite number")


def checked_rate(rate: float) -> float:
    """Return the rate. Raises RequestError unless it is in (0, 1)."""
    if not 0.0 < rate < 1.0:
        raise RequestError("false_alarm_rate", rate, "a number above 0 and below 1")
    return float(rate)


def alarm_json(state: AlarmState | None, off: str = "") -> dict[str, object]:
    """The field `alarm` of the JSON of `validate`; state None: no alarm is possible, for the reason `off`."""
    if state is None:
        return {"fired": False, "off": off}
    return {
        "fired": state.fired,
        "push_id": state.fired_at,
        "pushes": state.fired_after if state.fired else state.pushes,
        "log10_evidence": state.fired_evidence if state.fired else state.log10_evidence,
        "score": state.fired_by if state.fired else state.strongest,
        "false_alarm_rate": state.false_alarm_rate,
        "threshold": state.threshold,
        "calibration_pushes": state.calibration_pushes,
    }


def alarm_sentence(alarm: Mapping[str, Any]) -> str:
    """The field `alarm` of the JSON as a sentence: whether the model still fits, and the evidence."""
    if "off" in alarm:
        return f"No alarm was computed: {alarm['off']}"
    evidence, pushes = f"evidence of a change {_odds(alarm['log10_evidence'])}", alarm["pushes"]
    if not alarm["fired"]:
        needed = _odds(alarm["threshold"])
        return f"No alarm after {pushes} pushes: no change detected ({evidence}; the alarm needs {needed})."
    rate = f"false-alarm rate at most {100.0 * alarm['false_alarm_rate']:g} %"
    where = f"detected after {pushes} pushes, at {alarm['push_id']}"
    return f"The model no longer fits: {_finding(alarm['score'])} ({where}; {evidence}; {rate})."


def with_alarm(text: str, alarm: Mapping[str, object]) -> str:
    """The JSON text of a validation with the field `alarm` added."""
    return json.dumps({**json.loads(text), "alarm": dict(alarm)}, indent=2, allow_nan=False) + "\n"


def _odds(log10_evidence: float) -> str:
    return f"{10.0**log10_evidence:.3g} : 1" if log10_evidence < 3.0 else f"10^{log10_evidence:.0f} : 1"


def _finding(score: str) -> str:
    return "errors are too large" if score == SIZE else f"errors are biased ({score.replace('_', ' ')})"


class _Ranking:
    """The scores so far in sorted order, which makes ranking a new one fast."""

    def __init__(self, calibration: Array) -> None:
        self._sorted: list[float] = sorted(calibration.tolist())
        self._new: list[float] = []

    def p_value(self, score: float, chance: float) -> float:
        """Share of the scores, including the new one, that exceed it; ties count with the fraction `chance`."""
        low, high = bisect_left(self._sorted, score), bisect_right(self._sorted, score)
        above, equal = len(self._sorted) - high, high - low
        p_value = (above + chance * (equal + 1)) / (len(self._sorted) + 1)
        self._sorted.insert(low, score)
        if len(self._sorted) > MOST_KEPT:
            self._drop()
        self._new.append(score)
        return p_value

    def _drop(self) -> None:
        if self._new:
            self._sorted.pop(bisect_left(self._sorted, self._new.pop(0)))


class _Bets:
    """The test martingale of one score: capital in reserve, and capital in bets that start at different pushes."""

    def __init__(self, two_sided: bool) -> None:
        count = len(POWERS) * (2 if two_sided else 1)
        self._two_sided, self._count, self._seen = two_sided, count, 0
        self._log_running = np.full(count, -np.inf)

    def add(self, p_value: float) -> None:
        """Start bets with part of the reserve and settle all bets with a p value."""
        log_started = np.log((_reserve(self._seen) - _reserve(self._seen + 1)) / self._count)
        self._seen += 1
        tails = (p_value, 1.0 - p_value) if self._two_sided else (p_value,)
        won = np.concatenate([_log_bets(max(tail, SMALLEST)) for tail in tails])
        self._log_running = np.logaddexp(self._log_running, log_started) + won

    @property
    def log10(self) -> float:
        """Log10 of the total capital, which starts at 1."""
        running = np.logaddexp.reduce(self._log_running)
        return float(np.logaddexp(running, np.log(_reserve(self._seen))) / _LOG_10)


def _reserve(pushes: int) -> float:
    return float((1.0 + pushes / PATIENCE) ** -0.5)


def _log_bets(p_value: float) -> Array:
    return np.asarray(_LOG_POWERS + _BENDS * np.log(p_value))

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Kept scores of all methods on a recording, and what they gain over the deployed model, pooled over recordings.

A gain is the exact NLPD of the deployed model minus that of another, in nats per window summed over the outputs: above
zero is better. Intervals (95 %) come from resampling whole pushes, the same for both models.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.adaptation.methods import Scored, joined
from push_predictor.evaluation.estimate import Estimate, difference_by_push, of_draws, total_exact_nlpd
from push_predictor.evaluation.push_scores import PushScores, samples_of
from push_predictor.types import Array

FIELDS = tuple(PushScores.__dataclass_fields__)
LEAST = 0.1  # nats that the oracle gains; of less, no share is stated
Part = Callable[[Scored], PushScores | None]


@dataclass(frozen=True, eq=False)
class Record:
    """The scores on one Tuesday: of a rig of a simulator, after a change; pushes: ids in order of time."""

    rig: str
    change: str
    pushes: tuple[str, ...]
    methods: dict[str, Scored]

    @property
    def simulator(self) -> str:
        """Which simulator the rig is of."""
        return self.rig.rpartition("_")[0]


def save_record(path: Path, record: Record) -> None:
    """Write a record."""
    methods = {
        name: {
            "after": {str(seen): _listed(scores) for seen, scores in scored.after.items()},
            "running": _listed(scored.running),
            "seconds": list(scored.seconds),
        }
        for name, scored in record.methods.items()
    }
    content = {"rig": record.rig, "change": record.change, "pushes": list(record.pushes), "methods": methods}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))


def load_record(path: Path) -> Record:
    """Read a record."""
    content = json.loads(path.read_text())
    methods = {
        name: Scored(
            {int(seen): _scores(scores) for seen, scores in kept["after"].items()},
            _scores(kept["running"]),
            tuple(kept["seconds"]),
        )
        for name, kept in content["methods"].items()
    }
    return Record(content["rig"], content["change"], tuple(content["pushes"]), methods)


def after(seen: int) -> Part:
    """The scores after so many pushes, None where a method has none."""
    return lambda scored: scored.after.get(seen)


def pooled(records: Sequence[Record], method: str, part: Part) -> PushScores | None:
    """The scores of a method on the pushes of all records; None where it lacks one."""
    parts = []
    for record in records:
        scored = part(record.methods[method]) if method in record.methods else None
        if scored is None:
            return None
        ids = np.array([f"{record.rig}/{record.change}/{push}" for push in scored.push_id.tolist()])
        parts.append(replace(scored, push_id=ids))
    return joined(parts)


def first(record: Record, count: int) -> Record:
    """The record with the running scores of the first pushes alone, in order of time; extensions come too late."""
    wanted = record.pushes[:count]

    def cut(scored: Scored) -> Scored:
        row = {push: k for k, push in enumerate(scored.running.push_id.tolist())}
        rows = [row[push] for push in wanted]
        return replace(scored, running=PushScores(*(getattr(scored.running, field)[rows] for field in FIELDS)))

    return replace(record, methods={name: cut(s) for name, s in record.methods.items() if name != "extended"})


def gain(deployed: PushScores, other: PushScores) -> Estimate:
    """What another model gains over the deployed one."""
    return difference_by_push(other, deployed, total_exact_nlpd)


def share(deployed: PushScores, other: PushScores, oracle: PushScores) -> Estimate:
    """Its gain over that of the oracle; NaN where the oracle gains less than LEAST."""
    weights = samples_of(deployed.push_id)

    def gains(of: PushScores, w: Array | None) -> Array:
        return total_exact_nlpd(deployed.totals(w)) - total_exact_nlpd(of.totals(w))

    whole = float(gains(oracle, None)[0])
    if whole < LEAST:
        return Estimate(np.nan, np.nan, np.nan)
    return of_draws(float(gains(other, None)[0]) / whole, gains(other, weights) / gains(oracle, weights))


def coverage(scores: PushScores) -> Array:
    """Share (3,) of the windows in the 95 % interval of dx, dy, dtheta."""
    return np.asarray(scores.totals().coverage[0, :, -1])


def _listed(scores: PushScores) -> dict[str, object]:
    return {field: getattr(scores, field).tolist() for field in FIELDS}


def _scores(kept: dict[str, object]) -> PushScores:
    return PushScores(*(np.array(kept[field]) for field in FIELDS))

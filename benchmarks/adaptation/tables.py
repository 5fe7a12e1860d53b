# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the methods gain over the deployed model, pooled over recordings, as Markdown and JSON.

A gain is the exact NLPD of the deployed model minus that of another, in nats per window summed over the outputs: above
zero is better. Intervals (95 %) come from resampling whole pushes, the same for both models.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.adaptation.methods import Scored, joined
from benchmarks.adaptation.rigs import CHANGES, NOTHING
from benchmarks.support.scripts import piped, ruled
from push_predictor.evaluation.estimate import Estimate, difference_by_push, of_draws, total_exact_nlpd, total_nmse
from push_predictor.evaluation.push_scores import PushScores, samples_of
from push_predictor.types import Array

OTHERS = ("adapted", "headed", "retrained", "extended", "oracle")
HEAD = (
    "| rig | change | pushes | NLPD deployed | gain: adapted | headed | retrained | extended | oracle "
    "| share of the oracle's: adapted | headed | NMSE: deployed, adapted, headed, oracle | in 95 %: adapted | headed |"
)
LEAST = 0.1  # nats that the oracle gains; of less, no share is stated
SHARES = {10: 0.5, 30: 0.8}  # of the oracle's gain, to reach after so many pushes
LOSS, COVERED = 0.02, (0.93, 0.97)  # nats at most where nothing changed; mean coverage of the outputs


@dataclass(frozen=True, eq=False)
class Record:
    """The scores on one Tuesday of a rig after a change; pushes: ids in order of time."""

    rig: str
    change: str
    pushes: tuple[str, ...]
    methods: dict[str, Scored]


def rows(records: Sequence[Record]) -> list[dict[str, Any]]:
    """One row for each rig, each simulator, and all of them, by change and number of pushes seen or predicted."""
    groups: dict[tuple[str, str, str], list[Record]] = {}
    for r in records:
        for level, name in (("all", "all"), ("simulator", r.rig.rpartition("_")[0]), ("rig", r.rig)):
            groups.setdefault((level, name, r.change), []).append(r)
    found = []
    for (level, name, change), same in sorted(groups.items(), key=lambda item: (item[0][:2], _order(item[0][2]))):
        known = {"level": level, "rig": name, "change": change, "recordings": len(same)}
        for seen in sorted(set.intersection(*(set(r.methods["deployed"].after) for r in same))):
            for table in ("after", "next") if seen else ("after",):
                found.append({**known, "table": table, "pushes": seen, **numbers(same, table, seen)})
    return found


def numbers(records: Sequence[Record], table: str, seen: int) -> dict[str, Any]:
    """NLPD, NMSE and coverage (95 %) of all methods, gains over the deployed model, and shares of the oracle's.

    table: `after` so many pushes, or on the `next` ones.
    """
    every = {name: pooled(records, name, table, seen) for name in ("deployed", *OTHERS)}
    scores = {name: found for name, found in every.items() if found is not None}
    deployed, oracle = scores["deployed"], scores["oracle"]
    totals = {name: found.totals() for name, found in scores.items()}
    others = {name: found for name, found in scores.items() if name != "deployed"}
    return {
        "nlpd": {name: float(total_exact_nlpd(t)[0]) for name, t in totals.items()},
        "nmse": {name: float(total_nmse(t)[0]) for name, t in totals.items()},
        "coverage": {name: t.coverage[0, :, -1].tolist() for name, t in totals.items()},
        "gain": {name: difference_by_push(s, deployed, total_exact_nlpd).json() for name, s in others.items()},
        "share": {name: share(deployed, s, oracle).json() for name, s in others.items()},
    }


def pooled(records: Sequence[Record], method: str, table: str, seen: int) -> PushScores | None:
    """The scores of a method on the pushes of all records; None where it lacks one."""
    parts = [scores_of(r, method, table, seen) for r in records]
    known = [part for part in parts if part is not None]
    return joined(known) if len(known) == len(parts) else None


def scores_of(record: Record, method: str, table: str, seen: int) -> PushScores | None:
    """The scores of a method on one recording, under names of pushes that no other has."""
    scored = record.methods.get(method)
    if scored is None or (table == "next" and method == "extended"):  # which comes too late for these
        return None
    found = scored.after.get(seen)
    if table == "next":
        known = scored.running.push_id.tolist()
        rows = [known.index(push) for push in record.pushes[:seen]]
        found = PushScores(*(column[rows] for column in vars(scored.running).values()))
    return found and replace(found, push_id=np.char.add(f"{record.rig}/{record.change}/", found.push_id))


def share(deployed: PushScores, other: PushScores, oracle: PushScores) -> Estimate:
    """The gain of another over that of the oracle; NaN where the oracle gains less than LEAST."""

    def gains(of: PushScores, weights: Array | None = None) -> Array:
        return total_exact_nlpd(deployed.totals(weights)) - total_exact_nlpd(of.totals(weights))

    if (whole := float(gains(oracle)[0])) < LEAST:
        return Estimate(np.nan, np.nan, np.nan)
    weights = samples_of(deployed.push_id)
    return of_draws(float(gains(other)[0]) / whole, gains(other, weights) / gains(oracle, weights))


def markdown(found: Sequence[dict[str, Any]], table: str, level: str) -> str:
    """The rows of one table, after or next, at one level: all, simulator or rig."""
    lines = [ruled(HEAD)]
    for row in found:
        if (row["table"], row["level"]) == (table, level):
            gains = [_cell(row["gain"].get(name), "+.2f") for name in OTHERS]
            shares = [_cell(row["share"].get(name), ".2f") for name in ("adapted", "headed")]
            nmse = " ".join(
                f"{row['nmse'].get(name, np.nan):.3f}" for name in ("deployed", "adapted", "headed", "oracle")
            )
            covered = [" ".join(f"{c:.2f}" for c in row["coverage"].get(name, ())) for name in ("adapted", "headed")]
            head = (row["rig"], row["change"], str(row["pushes"]), f"{row['nlpd']['deployed']:.2f}")
            lines.append(piped([*head, *gains, *shares, nmse, *covered]))
    return "\n".join(lines) + "\n"


def verdict(found: Sequence[dict[str, Any]], method: str) -> Iterator[str]:
    """For each target, how many rows at the levels all and simulator reach it, and which do not."""
    for level in ("all", "simulator"):
        own = [row for row in found if row["level"] == level and method in row["gain"]]
        after = [row for row in own if row["table"] == "after"]
        for count, target in SHARES.items():
            shares = {_name(row): row["share"][method]["value"] for row in after if row["pushes"] == count}
            known = {name: value for name, value in shares.items() if value is not None}
            yield _line(f"{level}: {target} of the oracle's gain after {count} pushes", known, target, np.inf)
        same = {_name(row): row["gain"][method]["value"] for row in own if row["change"] == NOTHING}
        yield _line(f"{level}: loss of at most {LOSS} nats where nothing changed", same, -LOSS, np.inf)
        covered = {_name(row): float(np.mean(row["coverage"][method])) for row in after if row["pushes"]}
        yield _line(f"{level}: mean coverage from {COVERED[0]} to {COVERED[1]}", covered, *COVERED)


def _line(what: str, values: dict[str, float], low: float, high: float) -> str:
    missed = [f"{name} ({value:.3f})" for name, value in values.items() if not low <= value <= high]
    return f"* {what}: {len(values) - len(missed)} of {len(values)}" + (f"; not {', '.join(missed)}" if missed else "")


def _name(row: dict[str, Any]) -> str:
    return f"{row['rig']} {row['change']} {row['table']} {row['pushes']}"


def _order(change: str) -> tuple[int, str]:
    return CHANGES.index(change) if change in CHANGES else len(CHANGES), change


def _cell(estimate: dict[str, float | None] | None, form: str) -> str:
    if estimate is None or not any(estimate.values()):
        return ""  # not known, or the deployed model itself
    return Estimate(*(np.nan if v is None else v for v in estimate.values())).text(form)

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The tables as Markdown, and the same numbers as JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from benchmarks.adaptation.results import Part, Record, after, coverage, first, gain, pooled, share
from benchmarks.adaptation.rigs import CHANGES, NOTHING
from push_predictor.evaluation.estimate import Estimate, total_exact_nlpd, total_nmse

OTHERS = ("adapted", "headed", "retrained", "extended", "oracle")
HEAD = (
    "| rig | change | pushes | NLPD deployed | gain: adapted | headed | retrained | extended | oracle "
    "| share of the oracle's: adapted | headed | NMSE: deployed, adapted, oracle | in 95 %: deployed | adapted |"
)
SHARES = {10: 0.5, 30: 0.8}  # of the oracle's gain, to reach after so many pushes
LOSS, COVERED = 0.02, (0.93, 0.97)  # nats where nothing changed; coverage


def rows(records: Sequence[Record]) -> list[dict[str, Any]]:
    """One row for each rig, each simulator and all together, by change and number of pushes seen or predicted."""
    groups: dict[str, list[Record]] = {"all": list(records)}
    for record in records:
        groups.setdefault(record.simulator, []).append(record)
        groups.setdefault(record.rig, []).append(record)
    found = []
    for name, own in groups.items():
        for change in sorted({r.change for r in own}, key=lambda c: CHANGES.index(c) if c in CHANGES else len(CHANGES)):
            same = [record for record in own if record.change == change]
            level = "rig" if name in {r.rig for r in records} else "simulator" if name != "all" else "all"
            known = {"rig": name, "level": level, "change": change, "recordings": len(same)}
            seen = sorted(set.intersection(*(set(record.methods["deployed"].after) for record in same)))
            found += [{**known, "table": "after", "pushes": k, **_numbers(same, after(k))} for k in seen]
            for count in seen[1:]:
                begun = [first(record, count) for record in same]
                found.append({**known, "table": "next", "pushes": count, **_numbers(begun, lambda s: s.running)})
    return found


def _numbers(records: Sequence[Record], part: Part) -> dict[str, Any]:
    scores = {method: pooled(records, method, part) for method in ("deployed", *OTHERS)}
    deployed, oracle = scores["deployed"], scores["oracle"]
    assert deployed is not None
    others = {name: found for name in OTHERS if (found := scores[name]) is not None}
    return {
        "nlpd": {name: float(total_exact_nlpd(s.totals())[0]) for name, s in scores.items() if s is not None},
        "nmse": {name: float(total_nmse(s.totals())[0]) for name, s in scores.items() if s is not None},
        "coverage": {name: coverage(s).tolist() for name, s in scores.items() if s is not None},
        "gain": {name: gain(deployed, s).json() for name, s in others.items()},
        "share": {name: share(deployed, s, oracle).json() for name, s in others.items() if oracle and name != "oracle"},
    }


def markdown(found: Sequence[dict[str, Any]], table: str, level: str) -> str:
    """The rows of one table at one level: `rig`, `simulator` or `all`."""
    lines = [HEAD, "|" + 14 * " --- |"]
    for row in found:
        if (row["table"], row["level"]) == (table, level):
            gains = [_cell(row["gain"].get(name), "+.2f") for name in OTHERS]
            shares = [_cell(row["share"].get(name), ".2f") for name in ("adapted", "headed")]
            nmse = " ".join(f"{row['nmse'].get(name, np.nan):.3f}" for name in ("deployed", "adapted", "oracle"))
            covered = [" ".join(f"{c:.2f}" for c in row["coverage"].get(n, [])) for n in ("deployed", "adapted")]
            cells = [row["rig"], row["change"], row["pushes"], f"{row['nlpd']['deployed']:.2f}", *gains, *shares, nmse]
            lines.append("| " + " | ".join(map(str, (*cells, *covered))) + " |")
    return "\n".join(lines) + "\n"


def verdict(found: Sequence[dict[str, Any]], method: str) -> Iterator[str]:
    """Which of the targets a method reaches, pooled over all recordings and over each simulator."""
    for level in ("all", "simulator"):
        own = [row for row in found if row["level"] == level and row["table"] == "after" and row["pushes"] > 0]
        for seen, target in SHARES.items():
            known = [
                row for row in own if row["pushes"] == seen and row["share"].get(method, {}).get("value") is not None
            ]
            short = [_name(row, f"{row['share'][method]['value']:.2f}") for row in known
                     if row["share"][method]["value"] < target]  # fmt: skip
            yield _line(f"{level}: share {target} after {seen} pushes", len(known), short)
        same = [row for row in own if row["change"] == NOTHING]
        lost = [
            _name(row, f"{row['gain'][method]['value']:+.3f}") for row in same if row["gain"][method]["value"] < -LOSS
        ]
        yield _line(f"{level}: loss at most {LOSS} where nothing changed", len(same), lost)
        outside = [_name(row, " ".join(f"{c:.3f}" for c in row["coverage"][method])) for row in own
                   if not COVERED[0] <= float(np.mean(row["coverage"][method])) <= COVERED[1]]  # fmt: skip
        yield _line(f"{level}: mean coverage {COVERED[0]} to {COVERED[1]}", len(own), outside)


def _line(what: str, of: int, missed: Sequence[str]) -> str:
    return f"* {what}: {of - len(missed)} of {of}" + (f"; not {', '.join(missed)}" if missed else "")


def _name(row: dict[str, Any], value: str) -> str:
    return f"{row['rig']} {row['change']} {row['pushes']} ({value})"


def _cell(estimate: dict[str, float | None] | None, form: str) -> str:
    if estimate is None or estimate["value"] is None or not any(estimate.values()):
        return ""  # not known, or the deployed model itself
    return Estimate(*(np.nan if v is None else v for v in estimate.values())).text(form)


def seconds(records: Sequence[Record], method: str) -> str:
    """Median and largest processor time of an update."""
    every = np.array([s for record in records if method in record.methods for s in record.methods[method].seconds])
    median, most = 1e3 * np.median(every), 1e3 * every.max()
    return f"{method}: an update takes {median:.0f} ms of processor time, at most {most:.0f} ms"

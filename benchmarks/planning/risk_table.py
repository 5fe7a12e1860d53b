# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Tables of the runs of risk.py: all problems attempted, equal risk, and promised against realised risk.

Equal risk: a planner declines a problem if the promised risk exceeds its threshold before any push (without
uncertainty: if the margin is smaller). The thresholds of the problems with an even number are those at which at most a
given share of the odd ones fails, and the reverse. Intervals: 95 %, from resampling problems.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.support.scripts import piped, ruled
from push_predictor.evaluation.estimate import of_draws
from push_predictor.types import Array, BoolArray

DRAWS = 4000  # of the bootstrap
RISKS = (0.02, 0.05, 0.1)  # shares of failed runs
VARIANTS = ("none", "constant", "input-dependent, independent", "input-dependent, push effects")
BASE = "constant"


@dataclass(frozen=True, eq=False)
class Runs:
    """The runs of a variant on n problems.

    number (n,) of the problem; reached, failed (n,); pushes (n,); doubt (n,): the largest promised risk before any
    push, or minus the smallest margin; promised (n,): risk and probability of the first plan, NaN without one.
    """

    number: Array
    reached: BoolArray
    failed: BoolArray
    pushes: Array
    doubt: Array
    promised_risk: Array
    promised: Array


def tables(path: Path) -> str:
    """All tables as Markdown."""
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    parts = []
    for task in dict.fromkeys(row["task"] for row in rows):
        runs = _common([row for row in rows if row["task"] == task])
        parts += [f"## {task}: {len(next(iter(runs.values())).number)} problems", _attempted(runs), _calibration(runs)]
        parts += [_equal_risk(runs, risk) for risk in RISKS]
    return "\n\n".join(parts) + "\n"


def _common(rows: Sequence[dict[str, object]]) -> dict[str, Runs]:
    """Runs by variant, of the problems that every variant has run."""
    found: dict[str, dict[int, dict[str, Any]]] = {}
    for row in rows:
        found.setdefault(str(row["variant"]), {})[int(str(row["problem"]))] = row
    numbers = sorted(set.intersection(*(set(of) for of in found.values())))
    return {name: _runs([found[name][number] for number in numbers]) for name in VARIANTS if name in found}


def _runs(rows: Sequence[dict[str, Any]]) -> Runs:
    first = [row["promised"][0] if row["promised"] else {} for row in rows]
    doubt = [max((said.get("risk", -said.get("margin", 0.0)) for said in row["promised"]), default=1.0) for row in rows]
    return Runs(
        np.array([row["problem"] for row in rows]),
        np.array([row["result"] == "reached" for row in rows]),
        np.array([row["result"] == "failed" for row in rows]),
        np.array([row["pushes"] for row in rows], dtype=np.float64),
        np.array(doubt),
        np.array([said.get("risk", np.nan) for said in first]),
        np.array([said.get("probability", np.nan) for said in first]),
    )


def _attempted(runs: Mapping[str, Runs]) -> str:
    lines = [
        ruled(
            "| covariance | reached, % | failed, % | no plan or missed, % | reached more than constant, points "
            "| failed more, points | pushes more, both reached |"
        )
    ]
    base = runs[BASE]
    for name, of in runs.items():
        other = ~of.reached & ~of.failed
        both = of.reached & base.reached
        more = [
            _interval(100.0 * (of.reached.astype(float) - base.reached)),
            _interval(100.0 * (of.failed.astype(float) - base.failed)),
            _interval((of.pushes - base.pushes)[both], 2),
        ]
        cells = [name, _share(of.reached), _share(of.failed), f"{100.0 * other.mean():.0f}"]
        lines.append(piped(cells + (["–"] * 3 if of is base else more)))
    return "\n".join(lines)


def _calibration(runs: Mapping[str, Runs]) -> str:
    lines = [
        ruled(
            "| covariance | promised risk, % | failed, % | promised probability, % | reached, % "
            "| failure ranked above success |"
        )
    ]
    for name, of in runs.items():
        tried = np.isfinite(of.promised)
        risk = "–" if np.isnan(of.promised_risk).all() else f"{100.0 * np.nanmean(of.promised_risk):.1f}"
        promised = f"{100.0 * of.promised[tried].mean():.0f}"
        lines.append(piped([name, risk, _share(of.failed[tried]), promised, _share(of.reached[tried]), _ranked(of)]))
    return "\n".join(lines)


def _ranked(of: Runs) -> str:
    """Probability that a failed run was promised a larger risk than one that reached (area under the ROC curve)."""
    failed, reached = of.doubt[of.failed], of.doubt[of.reached]
    if not len(failed) or not len(reached):
        return "–"
    larger = (failed[:, None] > reached).mean() + 0.5 * (failed[:, None] == reached).mean()
    return f"{larger:.2f}"


def _equal_risk(runs: Mapping[str, Runs], risk: float) -> str:
    lines = [
        f"At most {100.0 * risk:g} % failed on the tuning problems:",
        "",
        ruled("| covariance | reached, % | failed, % | reached more than constant, points |"),
    ]
    accepted = {name: _accepted(of, risk) for name, of in runs.items()}
    base = runs[BASE].reached & accepted[BASE]
    for name, of in runs.items():
        reached = of.reached & accepted[name]
        more = "–" if name == BASE else _interval(100.0 * (reached.astype(float) - base))
        lines.append(piped([name, _share(reached), _share(of.failed & accepted[name]), more]))
    return "\n".join(lines)


def _accepted(of: Runs, risk: float) -> BoolArray:
    """The problems (n,) that a planner accepts with the threshold tuned on the other half."""
    accepted = np.zeros(len(of.number), dtype=np.bool_)
    for half in (0, 1):
        here = of.number % 2 == half
        accepted[here] = of.doubt[here] <= _threshold(of.doubt[~here], of.failed[~here], risk)
    return accepted


def _threshold(doubt: Array, failed: BoolArray, risk: float) -> float:
    """The largest doubt with at most that share of failed runs among all; -inf if there is none."""
    candidates = [level for level in np.unique(doubt) if (failed & (doubt <= level)).mean() <= risk]
    return float(max(candidates, default=-np.inf))


def _share(which: BoolArray) -> str:
    """Per cent of the problems."""
    return _interval(100.0 * which.astype(float))


def _interval(values: Array | BoolArray, digits: int = 1) -> str:
    """Mean with its 95 % interval."""
    if not len(values):
        return "–"
    rng = np.random.default_rng(0)
    drawn = values[rng.integers(0, len(values), (DRAWS, len(values)))].mean(axis=1)
    return of_draws(float(values.mean()), drawn).text(f".{digits}f")

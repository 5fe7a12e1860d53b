# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of active.py: scores by number of pushes, the pushes that each way needs for the same scores, differences.

Scores are pooled over the pushes to predict of all cases that every way has finished. Intervals (95 %) come from
resampling these pushes, the same for all ways; of simulated cases, which are pools of different rigs, the pools are
resampled first. A number of pushes is where the line between two sizes crosses the score that is to be reached, for the
first time.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.support.scripts import piped, ruled
from push_predictor.types import Array

DRAWS = 1000
REFERENCE = ("gp", "random")  # its scores with the most pushes are to be reached


@dataclass(frozen=True, eq=False)
class Curve:
    """Scores by size: nmse, nlpd (1 + DRAWS, s); the first row is that of all pushes, the others are resampled."""

    sizes: Array
    nmse: Array
    nlpd: Array


def print_tables(path: Path) -> None:
    """Print the tables of each kind of case as Markdown."""
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    for kind in dict.fromkeys(row["kind"] for row in rows):
        curves, cases = curves_of([row for row in rows if row["kind"] == kind])
        print(f"\n## {kind}: {', '.join(cases)}\n")
        _print_scores(curves)
        _print_needed(curves)
        _print_differences(curves)


def curves_of(rows: Sequence[Mapping[str, Any]]) -> tuple[dict[tuple[str, str], Curve], list[str]]:
    """The curve of each model and way, and the cases that all have finished."""
    ways = list(dict.fromkeys((row["model"], row["way"]) for row in rows))
    sizes = {way: sorted({row["pushes"] for row in rows if (row["model"], row["way"]) == way}) for way in ways}
    known = {(row["model"], row["way"], row["case"], row["pushes"]) for row in rows}
    names = sorted({row["case"] for row in rows})
    cases = [case for case in names if all((*way, case, n) in known for way in ways for n in sizes[way])]
    kept = [row for row in rows if row["case"] in cases]
    pushes = {case: len(next(row for row in kept if row["case"] == case)["push_id"]) for case in cases}
    groups = list(pushes.values()) if kept[0]["kind"] == "simulated" else [sum(pushes.values())]
    weights = np.concatenate([np.ones((1, sum(groups))), resampled(groups, np.random.default_rng(0))])
    return {way: _curve([row for row in kept if (row["model"], row["way"]) == way], weights) for way in ways}, cases


def resampled(groups: Sequence[int], rng: np.random.Generator) -> Array:
    """How often each push is drawn, (DRAWS, n): as many groups of these sizes as there are, then pushes of each."""
    times = rng.multinomial(len(groups), np.full(len(groups), 1.0 / len(groups)), DRAWS)
    parts = [
        rng.multinomial(size * drawn, np.full(size, 1.0 / size)) for size, drawn in zip(groups, times.T, strict=True)
    ]
    return np.concatenate(parts, axis=1).astype(np.float64)


def _curve(rows: Sequence[Mapping[str, Any]], weights: Array) -> Curve:
    sizes = sorted({row["pushes"] for row in rows})
    scores = [_pooled([row for row in rows if row["pushes"] == n], weights) for n in sizes]
    return Curve(np.array(sizes, dtype=np.float64), *(np.column_stack(column) for column in zip(*scores, strict=True)))


def _pooled(rows: Sequence[Mapping[str, Any]], weights: Array) -> tuple[Array, Array]:
    """NMSE and exact NLPD (1 + DRAWS,) of all cases, the mean over the draws of random pushes."""
    found = []
    for draw in sorted({row["draw"] for row in rows}):
        parts = sorted((row for row in rows if row["draw"] == draw), key=lambda row: str(row["case"]))
        order = [np.argsort(np.array(row["push_id"])) for row in parts]
        error, spread, nlpd, windows = (
            np.concatenate([np.array(row[key])[o] for row, o in zip(parts, order, strict=True)])
            for key in ("error", "spread", "exact_nlpd", "windows")
        )
        nmse = np.sum((weights @ error) / (weights @ spread), axis=1)
        found.append((nmse, (weights @ nlpd.sum(axis=1)) / (weights @ windows)))
    nmse_mean, nlpd_mean = (np.mean(column, axis=0) for column in zip(*found, strict=True))
    return nmse_mean, nlpd_mean


def needed(sizes: Array, scores: Array, target: Array) -> Array:
    """Pushes (d,) at which scores (d, s) first reach a target (d,); infinite where they do not."""
    found = np.full(len(scores), np.inf)
    for k in range(len(sizes) - 1, -1, -1):
        reached = scores[:, k] <= target
        if k == 0:
            at = np.full(len(scores), sizes[0])
        else:
            fall = np.maximum(scores[:, k - 1] - scores[:, k], 1e-12)
            share = np.clip((scores[:, k - 1] - target) / fall, 0.0, 1.0)
            at = sizes[k - 1] + share * (sizes[k] - sizes[k - 1])
        found = np.where(reached, at, found)
    return found


def _print_scores(curves: Mapping[tuple[str, str], Curve]) -> None:
    sizes = sorted({n for curve in curves.values() for n in curve.sizes.tolist()})
    print(ruled(piped(["model", "way", *(f"{n:.0f}" for n in sizes)])))
    for (model, way), curve in curves.items():
        known = dict(zip(curve.sizes.tolist(), zip(curve.nmse[0], curve.nlpd[0], strict=True), strict=True))
        cells = [f"{known[n][0]:.3f}, {_minus(known[n][1])}" if n in known else "" for n in sizes]
        print(piped([model, way, *cells]))


def _print_needed(curves: Mapping[tuple[str, str], Curve]) -> None:
    reference = curves[REFERENCE]
    most = reference.sizes[-1]
    heads = (f"pushes for the {score} of {most:.0f}" for score in ("NMSE", "NLPD"))
    print("\n" + ruled(piped(["model", "way", *heads])))
    for (model, way), curve in curves.items():
        nmse = needed(curve.sizes, curve.nmse, reference.nmse[:, -1])
        nlpd = needed(curve.sizes, curve.nlpd, reference.nlpd[:, -1])
        print(f"| {model} | {way} | {_cell(nmse, curve)} | {_cell(nlpd, curve)} |")


def _cell(pushes: Array, curve: Curve) -> str:
    low, high = np.quantile(pushes[1:], [0.025, 0.975], method="nearest")
    return f"{_count(pushes[0], curve)} ({_count(low, curve)} to {_count(high, curve)})"


def _count(pushes: float, curve: Curve) -> str:
    return f"{pushes:.0f}" if np.isfinite(pushes) else f"over {curve.sizes[-1]:.0f}"


def _print_differences(curves: Mapping[tuple[str, str], Curve]) -> None:
    """`suggest` minus the other ways on the same predicted pushes."""
    if "suggest" not in (ways := list(dict.fromkeys(way for _, way in curves))):
        return
    others = [way for way in ways if way != "suggest"]
    heads = [f"minus {way}: {score}" for way in others for score in ("NMSE", "NLPD")]
    print("\n" + ruled(piped(["model", "pushes", *heads])))
    for model in dict.fromkeys(model for model, way in curves if way == "suggest"):
        own = curves[model, "suggest"]
        for k, size in enumerate(own.sizes.tolist()):
            compared = [curves.get((model, way)) for way in others]
            cells = [cell for other in compared for cell in _differences(own, k, other)]
            print(piped([model, f"{size:.0f}", *cells]))


def _differences(own: Curve, k: int, other: Curve | None) -> list[str]:
    if other is None or own.sizes[k] not in other.sizes:
        return ["", ""]
    at = int(np.flatnonzero(other.sizes == own.sizes[k])[0])
    return [
        _interval(own.nmse[:, k] - other.nmse[:, at], 3),
        _interval(own.nlpd[:, k] - other.nlpd[:, at], 2),
    ]


def _interval(values: Array, digits: int) -> str:
    low, high = np.quantile(values[1:], [0.025, 0.975])
    return f"{_minus(values[0], digits)} ({_minus(low, digits)} to {_minus(high, digits)})"


def _minus(value: float, digits: int = 2) -> str:
    return f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "\N{MINUS SIGN}")

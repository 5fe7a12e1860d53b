# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Does a push reach the goal as often as predicted? Pushes of the repertoire, repeated at random places on the table.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.planning.planner_promises [--pushes N] [--repetitions R] [--model FILE]

The goal is the mean outcome. For each tolerance and each covariance (see planner.py): the share of pushes that end
within the tolerance, in bins of the predicted probability, and the correlation of predicted and observed shares.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.planning.planner import AREA, SEED, VARIANTS, WINDOW, repertoires_of, trained
from push_predictor.geometry.frames import to_body
from push_predictor.models.store.model_file import load_model
from push_predictor.models.tabulated.tabulated_model import tabulate
from push_predictor.planning.goal import Goal
from push_predictor.planning.repertoire import Repertoire
from push_predictor.simulation.interactive_rig import push_once
from push_predictor.simulation.pushes import PushPlan
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array, IntArray

TOLERANCES = ((0.001, 0.03), (0.002, 0.05), (0.004, 0.1))  # m, rad
BINS = (0.0, 0.3, 0.6, 0.8, 0.9, 0.97, 1.0 + 1e-9)


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pushes", type=int, default=150, help="drawn from the repertoire")
    parser.add_argument("--repetitions", type=int, default=16, help="of each push")
    parser.add_argument("--model", type=Path, help="a model of bags/square_abs_train (default: train one)")
    options = parser.parse_args(arguments)
    repertoires = repertoires_of(tabulate(load_model(options.model) if options.model else trained()))
    rng = np.random.default_rng(SEED)
    rows = rng.choice(len(repertoires[VARIANTS[0]]), options.pushes, replace=False)
    deviations = _deviations(repertoires[VARIANTS[0]], rows, options.repetitions, rng)
    print(_table(repertoires, rows, deviations))
    return 0


def _deviations(pushes: Repertoire, rows: IntArray, repetitions: int, rng: np.random.Generator) -> Array:
    """Final pose minus mean (n, repetitions, 3), in the body frames before the push."""
    of = pushes.pushes.take(np.repeat(rows, repetitions))
    velocity, contact, angle = of.inputs.T
    count = len(of)
    start = np.column_stack([rng.uniform(-AREA, AREA, (count, 2)), rng.uniform(-np.pi, np.pi, count)])
    plan = PushPlan(contact, angle, velocity, velocity * WINDOW * of.windows)
    end = push_once(SimulationSpec("rect1", "abs", plan, seed=SEED), start)
    moved = np.column_stack([to_body(end[:, :2], start), end[:, 2] - start[:, 2]])
    return np.asarray(moved.reshape(len(rows), repetitions, 3) - pushes.mean[rows, None])


def _table(repertoires: Mapping[str, Repertoire], rows: IntArray, deviations: Array) -> str:
    heads = [f"predicted {low:g} to {min(high, 1.0):g}" for low, high in pairwise(BINS)]
    lines = [f"| within | covariance | correlation | {' | '.join(heads)} |", "|---" * (3 + len(heads)) + "|"]
    for distance, turn in TOLERANCES:
        goal = Goal(np.zeros(3), distance, turn)
        kept = goal.reached(deviations).mean(axis=1)
        for name in VARIANTS[:-1]:
            of = repertoires[name]
            promised = goal.reached(of.outcomes[rows] - of.mean[rows, None]).mean(axis=1)
            same = np.ptp(promised) < 1e-9
            correlation = "–" if same else f"{np.corrcoef(promised, kept)[0, 1]:.2f}"
            cells = " | ".join(_bin(promised, kept, low, high) for low, high in pairwise(BINS))
            lines.append(f"| {1e3 * distance:g} mm, {turn:g} rad | {name} | {correlation} | {cells} |")
    return "\n".join(lines)


def _bin(promised: Array, kept: Array, low: float, high: float) -> str:
    """Mean predicted and observed share, and the number of pushes."""
    inside = (promised >= low) & (promised < high)
    if not inside.any():
        return "–"
    return f"{promised[inside].mean():.2f}: {kept[inside].mean():.2f} ({np.count_nonzero(inside)})"


if __name__ == "__main__":
    sys.exit(main())

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Speed of the rig simulator: simulated over computing time, and the paper's full grid of repeated pushes.

python -m benchmarks.recordings.simulation [--grid]
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from push_predictor.recordings.streams import Recording
from push_predictor.simulation.pushes import grid_pushes, random_pushes
from push_predictor.simulation.rig_simulator import SimulationSpec, push_outcomes, simulate

CASES = (
    ("rect1", 200, (0.01, 0.02, 0.05)),
    ("ellip2", 200, (0.01, 0.02, 0.05)),
    ("rect1", 200, (0.15,)),
    ("rect1", 10, (0.02,)),
    ("ellip1", 10, (0.02,)),
)


def main() -> None:
    """Print a line per case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--grid", action="store_true", help="also 11 contacts x 31 angles x 100 repetitions")
    options = parser.parse_args()
    for shape, n, speeds in CASES:
        spec = SimulationSpec(shape, "abs", random_pushes(n, speeds, 0.025), seed=1)
        begin = time.process_time()
        lasted = duration(simulate(spec))
        taken = time.process_time() - begin
        print(
            f"{shape} {n} pushes at {speeds} m/s: {lasted:.0f} s in {taken:.2f} s of one core, "
            f"{lasted / taken:.0f} times real time"
        )
    if options.grid:
        full_grid()


def duration(recording: Recording) -> float:
    """Seconds from the first to the last pose."""
    return float(recording.slider.stamp[-1] - recording.slider.stamp[0]) / 1e9


def full_grid() -> None:
    """The repeated pushes of Bauza and Rodriguez 2017: one side, 1 cm at 20 mm/s."""
    plan = grid_pushes(np.linspace(0.0125, 0.2375, 11), np.arange(-15, 16) / 10.0, 100)
    begin = time.process_time()
    table = push_outcomes(SimulationSpec("rect1", "abs", plan))
    print(f"grid of {len(plan)} pushes: {len(table)} windows in {time.process_time() - begin:.0f} s of one core")


if __name__ == "__main__":
    main()

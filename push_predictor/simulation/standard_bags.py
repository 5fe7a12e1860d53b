# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The recordings in bags/: specifications, and the command that writes them (make_bags.sh)."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from push_predictor.recordings.write import write_recording
from push_predictor.simulation.pushes import PushPlan, grid_pushes, random_pushes
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.simulation.sensors import Sensors
from push_predictor.simulation.spec import SimulationSpec

SPEEDS = (0.01, 0.02, 0.02, 0.02, 0.05)  # m/s; most pushes at one speed, so that maps over contact and angle are dense
TRAVEL = 0.02  # m
WRENCH_RATE = 50.0  # Hz; half the rate of the poses, to keep the recordings small


def standard_bags() -> dict[str, SimulationSpec]:
    """The specs by name. square_abs_* share slider and table; the pushes of every recording differ."""
    specs = (
        _spec("square_abs_train", "rect1", "abs", _random(220, 1), 1),
        _spec("square_abs_test", "rect1", "abs", _random(120, 2), 2),
        _spec("square_abs_repeats", "rect1", "abs", _repeats(), 3),
        _spec("ellipse_plywood", "ellip2", "plywood", _random(15, 4), 4),
        _spec("circle_pu", "ellip1", "pu", _random(10, 5), 5),
        _spec("hexagon_delrin", "hex", "delrin", _random(10, 6), 6),
    )
    return {spec.name: spec for spec in specs}


def main(arguments: list[str] | None = None) -> int:
    """Write all recordings, or the named ones, into a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="recordings to write (default: all)")
    parser.add_argument("--out", type=Path, default=Path("bags"), help="folder to write them to")
    options = parser.parse_args(arguments)
    specs = standard_bags()
    if unknown := [name for name in options.names if name not in specs]:
        parser.error(f"no recording named {', '.join(unknown)}; give some of {', '.join(specs)}")
    for name in options.names or specs:
        write_recording(options.out / name, simulate(specs[name]))
        print(f"{options.out / name}: {len(specs[name].pushes)} pushes", file=sys.stderr)
    return 0


def _spec(name: str, shape: str, surface: str, pushes: PushPlan, seed: int) -> SimulationSpec:
    sensors = Sensors(wrench_rate=WRENCH_RATE)
    return SimulationSpec(shape, surface, pushes, seed=seed, surface_seed=0, name=name, sensors=sensors)


def _random(n: int, seed: int) -> PushPlan:
    return random_pushes(n, SPEEDS, TRAVEL, np.random.default_rng([seed, 0]))


def _repeats() -> PushPlan:
    """Four contacts on the first side by five angles, each four times: 1 cm at 20 mm/s."""
    return grid_pushes(np.linspace(0.03, 0.18, 4), np.linspace(-1.0, 1.0, 5), 4)


if __name__ == "__main__":
    sys.exit(main())

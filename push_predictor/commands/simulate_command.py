# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor simulate: write a recording of simulated pushes."""

from __future__ import annotations

import argparse

from push_predictor.commands.common.command import Option, command
from push_predictor.commands.common.options import TRAVEL, out_option, seed_option
from push_predictor.commands.common.output import write_json
from push_predictor.commands.common.progress import progress
from push_predictor.watch import part_of

BEFORE_WRITING = 0.6  # share of the time


@command(
    "simulate",
    "Simulate random pushes and write them as a recording.",
    "push_predictor simulate --shape rect1 --surface abs --pushes 60 --speed 0.02 0.05 --seed 1 --out pushes",
    Option("--shape", required=True, help="slider: rect1 (square), ellip1 (circle), ellip2, ellip3 (ellipses) or hex"),
    Option("--surface", required=True, metavar="NAME", help="name of the surface: plywood, delrin, pu or abs"),
    Option("--pushes", required=True, type=int, metavar="N", help="number of pushes"),
    Option("--speed", required=True, type=float, nargs="+", metavar="V", help="pusher speeds in m/s"),
    TRAVEL,
    seed_option("pushes, surface and sensors"),
    out_option("the recording, a folder or FILE.mcap", lambda path: path.suffix != ".mcap"),
)
def run(options: argparse.Namespace) -> None:
    """Simulate the pushes and write the recording."""
    import numpy as np

    from push_predictor.errors import RequestError
    from push_predictor.recordings.write import write_recording
    from push_predictor.simulation.pushes import random_pushes
    from push_predictor.simulation.rig_simulator import SimulationSpec, simulate

    if options.pushes < 1:
        raise RequestError("--pushes", options.pushes, "an integer of at least 1")
    rng = np.random.default_rng([options.seed, 0])
    plan = random_pushes(options.pushes, options.speed, options.travel, rng)
    name = options.out.name.removesuffix(".mcap")
    with progress("simulate") as watch:
        spec = SimulationSpec(options.shape, options.surface, plan, seed=options.seed, name=name)
        recording = simulate(spec, part_of(watch, 0.0, BEFORE_WRITING))
        watch("write", BEFORE_WRITING)
        write_recording(options.out, recording)
    seconds = float(recording.slider.stamp[-1] - recording.slider.stamp[0]) * 1e-9
    if not write_json(options, {"recording": str(options.out), "pushes": options.pushes, "seconds": seconds}):
        print(f"{options.out}: {options.pushes} pushes, {seconds:.1f} s")

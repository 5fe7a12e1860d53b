"""push_predictor simulate: write a recording of simulated pushes."""

from __future__ import annotations

import argparse
from pathlib import Path

from push_predictor.commands.output import add_command, check_output, check_seed, progress, write_json


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the sub-command `simulate`."""
    parser = add_command(
        commands,
        "simulate",
        "Simulate random pushes and write them as a recording.",
        "push_predictor simulate --shape rect1 --surface abs --pushes 60 --speed 0.02 0.05 --seed 1 --out pushes",
    )
    parser.add_argument(
        "--shape", required=True, help="slider: rect1 (square), ellip1 (circle), ellip2, ellip3 (ellipses) or hex"
    )
    parser.add_argument("--surface", required=True, help="table: plywood, delrin, pu or abs")
    parser.add_argument("--pushes", required=True, type=int, metavar="N", help="number of pushes")
    parser.add_argument("--speed", required=True, type=float, nargs="+", metavar="V", help="pusher speeds in m/s")
    parser.add_argument(
        "--travel", type=float, default=0.03, metavar="D", help="length of each push in m (default %(default)s)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="K", help="random seed: the same seed gives the same recording"
    )
    parser.add_argument("--out", required=True, type=Path, metavar="RECORDING", help="output: a folder, or FILE.mcap")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Simulate the pushes and write the recording."""
    import numpy as np

    from push_predictor.errors import RequestError
    from push_predictor.recordings.write import write_recording
    from push_predictor.simulation.pushes import random_pushes
    from push_predictor.simulation.rig_simulator import SimulationSpec, simulate

    if options.pushes < 1:
        raise RequestError("--pushes", options.pushes, "an integer of at least 1")
    check_seed(options.seed)
    check_output("--out", options.out, folder=options.out.suffix != ".mcap")
    rng = np.random.default_rng([options.seed, 0])
    plan = random_pushes(options.pushes, options.speed, options.travel, rng)
    name = options.out.name.removesuffix(".mcap")
    with progress("simulate"):
        recording = simulate(SimulationSpec(options.shape, options.surface, plan, seed=options.seed, name=name))
        write_recording(options.out, recording)
    seconds = float(recording.slider.stamp[-1] - recording.slider.stamp[0]) * 1e-9
    if not write_json(options, {"recording": str(options.out), "pushes": options.pushes, "seconds": seconds}):
        print(f"{options.out}: {options.pushes} pushes, {seconds:.1f} s")

"""push_predictor simulate: a recording from the rig simulator."""

from __future__ import annotations

import argparse
from pathlib import Path

from push_predictor.commands.output import add_command, check_output, check_seed, progress, write_json


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """The sub-command `simulate`."""
    parser = add_command(
        commands,
        "simulate",
        "Make a recording of random pushes with the rig simulator.",
        "push_predictor simulate --shape rect1 --surface abs --pushes 60 --speed 0.02 0.05 --seed 1 --out pushes",
    )
    parser.add_argument("--shape", required=True, help="rect1, ellip1, ellip2, ellip3 or hex")
    parser.add_argument("--surface", required=True, help="plywood, delrin, pu or abs")
    parser.add_argument("--pushes", required=True, type=int, metavar="N", help="how many")
    parser.add_argument("--speed", required=True, type=float, nargs="+", metavar="V", help="pusher speeds, m/s")
    parser.add_argument("--travel", type=float, default=0.03, help="m that each push drives (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, metavar="K", help="same seed, same recording")
    parser.add_argument("--out", required=True, type=Path, metavar="RECORDING", help="folder, or FILE.mcap")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Simulate and write."""
    import numpy as np

    from push_predictor.errors import RequestError
    from push_predictor.recordings.write import write_recording
    from push_predictor.simulation.pushes import random_pushes
    from push_predictor.simulation.rig_simulator import SimulationSpec, simulate

    if options.pushes < 1:
        raise RequestError("--pushes", options.pushes, "a number from 1 on")
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

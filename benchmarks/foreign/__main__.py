# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings of planar pushing on a simulated rig that shares no code with the project, with hidden changes.

    python -m benchmarks.foreign make --out DATA --truth TRUTH --seed S --count N
        [--training 500] [--later 600] [--cores 1]
    python -m benchmarks.foreign train --data DATA [--rows 500] [--cores 1]

For each number NNN of 0 to N - 1 `make` writes DATA/NNN/training and DATA/NNN/new, two bags of one rig, and
TRUTH/NNN.json, which states what changed between them. `train` writes DATA/NNN/model.json, the default model of
DATA/NNN/training; after it, `python -m benchmarks.blind` with run, oracle and score accepts DATA and TRUTH. Running a
command again continues an interrupted run.

The physics differ on purpose from limit-surface mechanics. The slider's base is a set of patches with uneven
pressure that rub on a slightly uneven table with rate-dependent friction. The tip is compliant. The slider has
inertia. Load and frictions vary at random between and within pushes.

Keys of a truth file: number, group (none, input_shift, wrench, measurement, variance, library, outside), seed,
engine, shape, surface, friction (mean coefficient of the table), pushes (of the new recording), training_pushes,
channel, kind (this package's name of the change), names (right mechanism names, null for a change without a name),
covariates (right drivers), form, size, value and unit, place (push index of a step), place_time (s from the
recording's start), second (a second effect or null), and clean_ratio: the root-mean-square change of noise-free
displacements over 0.2 s windows, in units of their difference between two draws of the process noise.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.foreign.recording import RecordingSpec, make_recording
from benchmarks.support.making import add_make, truth_file


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return its exit status."""
    options = _parser().parse_args(arguments)
    work: Callable[[argparse.Namespace], int] = options.work
    return work(options)


def make(options: argparse.Namespace, number: int) -> None:
    """Make one pair from scratch; what an interrupted run left of it is removed."""
    folder = options.out / f"{number:03d}"
    shutil.rmtree(folder, ignore_errors=True)
    spec = RecordingSpec(options.seed, number, options.count, options.training, options.later)
    make_recording(spec, folder, truth_file(options, number))


def _train(options: argparse.Namespace) -> int:
    # Imported on demand: making recordings needs nothing of the project.
    from benchmarks.foreign.train import train_all

    train_all(options.data, options.rows, options.cores)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.foreign", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True)
    add_make(commands.add_parser("make", help="make recordings and their truth"), make)
    command = commands.add_parser("train", help="train the default model of each training recording")
    command.set_defaults(work=_train)
    command.add_argument("--data", type=Path, required=True, help="folder of the recordings")
    command.add_argument("--rows", type=int, default=500, help="training rows of a model (default %(default)s)")
    command.add_argument("--cores", type=int, default=1, help="processes")
    return parser


if __name__ == "__main__":
    sys.exit(main())

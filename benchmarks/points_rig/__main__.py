# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Command line: `python -m benchmarks.points_rig make --out DATA --truth TRUTH --seed S --count N`."""

import argparse
import time
from pathlib import Path

from benchmarks.points_rig.pairs import make_pair, write_pair


def main() -> None:
    """Make the pairs of recordings that are still missing."""
    arguments = _parser().parse_args()
    data, truth = arguments.out.resolve(), arguments.truth.resolve()
    if data == truth or data in truth.parents or truth in data.parents:
        raise SystemExit("--out and --truth must not contain each other.")
    for number in range(arguments.count):
        if (truth / f"{number:03d}.json").exists():
            print(f"{number:03d}: already made", flush=True)
            continue
        begin, begin_cpu = time.perf_counter(), time.process_time()
        write_pair(make_pair(arguments.seed, number, arguments.training, arguments.later), data, truth)
        wall, cpu = time.perf_counter() - begin, time.process_time() - begin_cpu
        print(f"{number:03d}: {wall:.1f} s, {cpu:.1f} s of CPU", flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.points_rig")
    make = parser.add_subparsers(required=True).add_parser("make", help="make pairs of recordings with their truth")
    make.add_argument("--out", type=Path, required=True, help="folder of the recordings")
    make.add_argument("--truth", type=Path, required=True, help="folder of the truth files")
    make.add_argument("--seed", type=int, required=True)
    make.add_argument("--count", type=int, required=True, help="number of pairs")
    make.add_argument("--training", type=int, default=500, help="pushes in each training recording")
    make.add_argument("--later", type=int, default=600, help="pushes in each new recording")
    return parser


if __name__ == "__main__":
    main()

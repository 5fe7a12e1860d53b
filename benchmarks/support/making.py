# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The command `make` of the independent rigs: numbered pairs of recordings, each with its truth in another folder."""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
from collections.abc import Callable
from pathlib import Path

Make = Callable[[argparse.Namespace, int], None]


def add_make(parser: argparse.ArgumentParser, make: Make) -> None:
    """Add the options of `make`; make(options, number) writes the recordings and, last, the truth file."""
    parser.set_defaults(work=make_missing, make=make)
    parser.add_argument("--out", type=Path, required=True, help="folder of the recordings")
    parser.add_argument("--truth", type=Path, required=True, help="folder of the truth files")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, required=True, help="number of pairs of recordings")
    parser.add_argument("--training", type=int, default=500, help="pushes of each training recording")
    parser.add_argument("--later", type=int, default=600, help="pushes of each new recording")
    parser.add_argument("--cores", type=int, default=1, help="processes")


def make_missing(options: argparse.Namespace) -> int:
    """Make the pairs without a truth file, so that an interrupted run continues; return the exit status."""
    apart(options.out, options.truth)
    options.truth.mkdir(parents=True, exist_ok=True)
    jobs = [(options, k) for k in range(options.count) if not truth_file(options, k).exists()]
    if options.cores == 1:
        for job in jobs:
            _timed(job)
        return 0
    with multiprocessing.Pool(options.cores) as pool:
        for _ in pool.imap_unordered(_timed, jobs):
            pass
    return 0


def truth_file(options: argparse.Namespace, number: int) -> Path:
    """The truth file of a pair."""
    return Path(options.truth) / f"{number:03d}.json"


def apart(data: Path, truth: Path) -> None:
    """Raise SystemExit if one folder lies in the other: the trace must not find the truth."""
    one, other = data.resolve(), truth.resolve()
    if one == other or one in other.parents or other in one.parents:
        raise SystemExit(f"--truth: {truth} and {data} must not contain each other")


def _timed(job: tuple[argparse.Namespace, int]) -> None:
    options, number = job
    began = time.process_time()
    options.make(options, number)
    print(f"{number:03d}: {time.process_time() - began:.1f} s of CPU", file=sys.stderr, flush=True)

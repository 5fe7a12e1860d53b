# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Make a set of recordings; one that exists is kept, so that an interrupted run can continue."""

from __future__ import annotations

import argparse
import multiprocessing
import shutil
import sys
import time
from importlib.util import find_spec
from pathlib import Path

from benchmarks.foreign.recording import RecordingSpec, make_recording

MUJOCO_EVERY = 10  # recordings of a mixed set


def make(options: argparse.Namespace) -> int:
    """Make the missing recordings; return the exit status."""
    data, truth = options.out.resolve(), options.truth.resolve()
    if data == truth or data in truth.parents or truth in data.parents:
        print(f"--out {data} and --truth {truth} must not contain each other.", file=sys.stderr)
        return 2
    if options.engine != "own" and find_spec("mujoco") is None:
        print(f"--engine {options.engine} needs MuJoCo: pip install '.[foreign]', or --engine own.", file=sys.stderr)
        return 2
    data.mkdir(parents=True, exist_ok=True)
    truth.mkdir(parents=True, exist_ok=True)
    jobs = [(spec, data, truth) for spec in specs_of(options) if not _truth_file(truth, spec).exists()]
    if options.cores == 1:
        for job in jobs:
            _make(job)
        return 0
    with multiprocessing.Pool(options.cores) as pool:
        for _ in pool.imap_unordered(_make, jobs):
            pass
    return 0


def specs_of(options: argparse.Namespace) -> list[RecordingSpec]:
    """The recordings to make; in a mixed set the last of every ten is made with MuJoCo."""
    specs = []
    for number in range(options.count):
        last_of_ten = number % MUJOCO_EVERY == MUJOCO_EVERY - 1
        engine = ("mujoco" if last_of_ten else "own") if options.engine == "mixed" else options.engine
        specs.append(RecordingSpec(options.seed, number, options.count, engine, options.training, options.later))
    return specs


def _truth_file(truth: Path, spec: RecordingSpec) -> Path:
    return truth / f"{spec.number:03d}.json"


def _make(job: tuple[RecordingSpec, Path, Path]) -> None:
    """Make one recording from scratch; what an interrupted run left of it is removed."""
    spec, data, truth = job
    began = time.monotonic()
    folder = data / f"{spec.number:03d}"
    shutil.rmtree(folder, ignore_errors=True)
    make_recording(spec, folder, _truth_file(truth, spec))
    print(f"{folder}: {time.monotonic() - began:.0f} s", file=sys.stderr, flush=True)

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""False-alarm rate of the alarm: many recordings without a change, about models of many simulated rigs.

    python -m benchmarks.blind.null_streams --out FOLDER [--models 40] [--streams 5] [--first 1000] [--markdown FILE]

For each seed from `--first` on, a rig is drawn as for the blind recordings. A VHGP and an analytical model are trained
on 250 pushes (500 windows), and later recordings of 150 pushes follow, all without a change. Each is judged at the
rate 0.01. Everything stays in memory. FOLDER has one file per seed: a second run computes only those that are missing,
so a run may be interrupted. The recordings of a seed share a training recording, so their false alarms are not
independent.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.blind.alarm import state_of, table_of
from benchmarks.blind.recordings import later_spec, rig_of
from benchmarks.blind.scores import wilson
from push_predictor.evaluation.alarm.evidence import DEFAULT_RATE
from push_predictor.evaluation.alarm.scores import calibrate
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.simulation.spec import simulated_rig

KINDS = ("vhgp", "analytical")
TRAINING, LATER, ROWS = 250, 150, 500


@dataclass(frozen=True)
class Stream:
    """The alarm on one recording without a change.

    fired: pushes until the alarm, None without one; by: the score that fired. evidence: log10, at the end.
    """

    seed: int
    rig: str
    kind: str
    fired: int | None
    by: str | None
    evidence: float


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge the recordings that are missing, and print the table of all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder of the results")
    parser.add_argument("--models", type=int, default=40, help="rigs (default 40)")
    parser.add_argument("--streams", type=int, default=5, help="later recordings of each (default 5)")
    parser.add_argument("--first", type=int, default=1000, help="first seed (default 1000)")
    parser.add_argument("--markdown", type=Path, help="file for the table")
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    for seed in range(options.first, options.first + options.models):
        file = options.out / f"{seed}.json"
        if not file.exists():
            begin = time.monotonic()
            found = [asdict(stream) for stream in streams_of(seed, options.streams)]
            file.write_text(json.dumps(found, indent=1) + "\n")
            print(f"seed {seed}: {time.monotonic() - begin:.0f} s", file=sys.stderr, flush=True)
    files = (options.out / f"{seed}.json" for seed in range(options.first, options.first + options.models))
    text = markdown_of([Stream(**one) for file in files for one in json.loads(file.read_text())])
    if options.markdown:
        options.markdown.write_text(text)
    print(text)
    return 0


def streams_of(seed: int, count: int) -> Iterator[Stream]:
    """The later recordings of one seed, by each kind of model."""
    rng = np.random.default_rng([seed, 7])
    rig = rig_of(rng, f"{seed}", TRAINING)
    training = table_of(rig)
    later = [table_of(later_spec(rig, rng, LATER)) for _ in range(count)]
    options = TrainingOptions(n_train=ROWS, seed=seed, mean="zero")
    for kind in KINDS:
        model = train_model(training, simulated_rig(rig), kind, name=f"{seed}", options=options)
        calibration = calibrate(model)
        for table in later:
            state = state_of(model, calibration, table)
            name = f"{rig.shape} on {rig.surface}"
            yield Stream(seed, name, kind, state.fired_after, state.fired_by, state.log10_evidence)


def markdown_of(streams: Sequence[Stream]) -> str:
    """The table for the documentation, with 95 % Wilson intervals."""
    lines = [
        f"| base | rigs | recordings of {LATER} pushes | false alarms | share | 95 % interval | rigs with one |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for kind in KINDS:
        own = [stream for stream in streams if stream.kind == kind]
        false = [stream for stream in own if stream.fired is not None]
        low, high = wilson(len(false), len(own))
        rigs, with_one = len({stream.seed for stream in own}), len({stream.seed for stream in false})
        share = len(false) / max(len(own), 1)
        lines.append(
            f"| {kind} | {rigs} | {len(own)} | {len(false)} | {share:.3f} | {low:.3f} to {high:.3f} | {with_one} |"
        )
    lines.append(f"\nRate: {DEFAULT_RATE:g}. False alarms:")
    lines += [f"- seed {s.seed}, {s.rig}, {s.kind}: {s.by}, push {s.fired}" for s in streams if s.fired is not None]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main())

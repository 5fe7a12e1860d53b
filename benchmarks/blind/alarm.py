# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""False-alarm rate and delay of the alarm, on simulated recordings.

    python -m benchmarks.blind.alarm unchanged --out FOLDER [--models 40] [--streams 5] [--first 1000]
    python -m benchmarks.blind.alarm changed [--seeds 8]

Rigs are drawn as for the blind recordings, and every later recording is judged at the rate 0.01.

unchanged: for each seed from --first on, a VHGP and an analytical model of 250 pushes (500 windows) judge --streams
recordings of 150 pushes without a change. FOLDER has one file per seed: an interrupted run continues. The recordings
of a seed share a training recording, so their false alarms are not independent.
changed: for each seed a VHGP of 1000 windows of 500 pushes judges a recording of 300 pushes, in which the contact
friction rises by 0.25 (a medium effect) at a push between the 90th and the 210th.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.blind.recordings import later_spec, rig_of, windows_of
from benchmarks.blind.scores import wilson
from benchmarks.support.scripts import parser_of, piped, ruled
from push_predictor.evaluation.alarm.evidence import AlarmState
from push_predictor.evaluation.alarm.scores import Calibration, alarm_state, calibrate
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.simulation.changes import Changes, Moment
from push_predictor.simulation.spec import SimulationSpec, simulated_rig
from push_predictor.types import Array

KINDS = ("vhgp", "analytical")
TRAINING, LATER, ROWS = 250, 150, 500  # pushes, pushes, windows: without a change
LONG_TRAINING, LONG_LATER, MANY_ROWS = 500, 300, 1000  # with one
RISE = 0.25  # of the contact friction: a medium effect of benchmarks/blind/effects.py
SHARES = (0.3, 0.7)  # of the later pushes, between which the change comes


@dataclass(frozen=True)
class Row:
    """The alarm on one recording.

    kind: of the model. change: the push before which the change came, None without one. fired: number of pushes seen
    when the alarm fired, None if it did not; by: the score that fired.
    """

    seed: int
    rig: str
    kind: str
    change: int | None
    fired: int | None
    by: str | None

    @property
    def delay(self) -> int | None:
        """Pushes from the change to the alarm; None without a change, a detection, or if the alarm fired before."""
        late = self.change is not None and self.fired is not None and self.fired > self.change
        return self.fired - self.change if late and self.fired is not None and self.change is not None else None

    @property
    def false(self) -> bool:
        """Whether it fired without a change."""
        return self.fired is not None and self.delay is None


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge the recordings and print the table."""
    parser = parser_of(__doc__)
    commands = parser.add_subparsers(required=True)
    command = commands.add_parser("unchanged")
    command.set_defaults(work=_unchanged)
    command.add_argument("--out", type=Path, required=True, help="folder of the results")
    command.add_argument("--models", type=int, default=40, help="rigs (default 40)")
    command.add_argument("--streams", type=int, default=5, help="later recordings of each (default 5)")
    command.add_argument("--first", type=int, default=1000, help="first seed (default 1000)")
    command = commands.add_parser("changed")
    command.set_defaults(work=_changed)
    command.add_argument("--seeds", type=int, default=8)
    options = parser.parse_args(arguments)
    work: Callable[[argparse.Namespace], str] = options.work
    print(work(options))
    return 0


def _unchanged(options: argparse.Namespace) -> str:
    options.out.mkdir(parents=True, exist_ok=True)
    files = [options.out / f"{seed}.json" for seed in range(options.first, options.first + options.models)]
    for file in (file for file in files if not file.exists()):
        found = [asdict(row) for row in rows_without_change(int(file.stem), options.streams)]
        file.write_text(json.dumps(found, indent=1) + "\n")
        print(file, file=sys.stderr, flush=True)
    rows = [Row(**one) for file in files for one in json.loads(file.read_text())]
    lines = [ruled("| base | rigs | false alarms | 95 % interval | rigs with one |")]
    for kind in KINDS:
        own = [row for row in rows if row.kind == kind]
        false = [row for row in own if row.false]
        low, high = wilson(len(false), len(own))
        rigs, with_one = len({row.seed for row in own}), len({row.seed for row in false})
        lines.append(piped([kind, rigs, f"{len(false)} of {len(own)}", f"{low:.3f} to {high:.3f}", with_one]))
    return "\n".join([*lines, *(f"- {row}" for row in rows if row.false)])


def _changed(options: argparse.Namespace) -> str:
    rows = []
    for seed in range(options.seeds):
        rows.append(row_with_change(seed))
        print(rows[-1], file=sys.stderr, flush=True)
    delays = sorted(row.delay for row in rows if row.delay is not None)
    lines = [ruled("| event | count | of | 95 % interval |")]
    counts = {"false alarms, before the change": sum(row.false for row in rows), "changes reported": len(delays)}
    for what, count in counts.items():
        low, high = wilson(count, len(rows))
        lines.append(piped([what, count, len(rows), f"{low:.2f} to {high:.2f}"]))
    return "\n".join([*lines, f"\nPushes until the alarm: {', '.join(map(str, delays))}."])


def rows_without_change(seed: int, count: int) -> Iterator[Row]:
    """The later recordings of one seed, by each kind of model."""
    rng = np.random.default_rng([seed, 7])
    rig = rig_of(rng, f"{seed}", TRAINING)
    training = windows_of(rig)
    later = [windows_of(later_spec(rig, rng, LATER)) for _ in range(count)]
    for kind in KINDS:
        model = _trained(training, rig, kind, seed, ROWS)
        calibration = calibrate(model)
        for table in later:
            yield _row(seed, rig, kind, None, _state_of(model, calibration, table))


def row_with_change(seed: int) -> Row:
    """A recording in which the contact friction rises."""
    rng = np.random.default_rng([seed, 7])
    rig = rig_of(rng, f"{seed}", LONG_TRAINING)
    _, later = (later_spec(rig, rng, LONG_LATER) for _ in range(2))
    change = int(rng.integers(round(SHARES[0] * LONG_LATER), round(SHARES[1] * LONG_LATER)))
    later = replace(later, changes=Changes(contact_friction=partial(_risen, change)))
    model = _trained(windows_of(rig), rig, "vhgp", seed, MANY_ROWS)
    return _row(seed, rig, "vhgp", change, _state_of(model, calibrate(model), windows_of(later)))


def _risen(change: int, moment: Moment) -> Array:
    return np.where(moment.conditions.values["push_index"] >= change, RISE, 0.0)


def _row(seed: int, rig: SimulationSpec, kind: str, change: int | None, state: AlarmState) -> Row:
    return Row(seed, f"{rig.slider.name} on {rig.table.name}", kind, change, state.fired_after, state.fired_by)


def _trained(table: PushTable, rig: SimulationSpec, kind: str, seed: int, rows: int) -> PushModel:
    options = TrainingOptions(n_train=rows, seed=seed, mean="zero")
    return train_model(table, simulated_rig(rig), kind, name=f"{seed}", options=options)


def _state_of(model: PushModel, calibration: Calibration, table: PushTable) -> AlarmState:
    """The state of the alarm after all pushes of a table."""
    prediction = model.predict_rows(table.inputs, table.duration, table.covariates)
    return alarm_state(calibration, table, prediction.mean, prediction.covariance)


if __name__ == "__main__":
    sys.exit(main())

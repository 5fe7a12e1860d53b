# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""False-alarm rate and delay of the alarm about a VHGP, on simulated recordings.

    python -m benchmarks.blind.alarm [--seeds 8] [--json FILE] [--markdown FILE]

For each seed a rig is drawn and a VHGP of 1000 windows is trained on 500 pushes. Two later recordings of 300 pushes
follow: one without a change, and one in which the contact friction rises by 0.25 (a medium effect) at a push between
the 90th and the 210th.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.blind.recordings import later_spec, rig_of
from benchmarks.blind.scores import wilson
from push_predictor.evaluation.alarm.evidence import AlarmState
from push_predictor.evaluation.alarm.scores import Calibration, alarm_state, calibrate
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.simulation.changes import Changes, Moment
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.simulation.spec import SimulationSpec, simulated_rig
from push_predictor.types import Array

TRAINING, LATER, ROWS = 500, 300, 1000
RISE = 0.25  # of the contact friction: a medium effect of benchmarks/blind/effects.py
SHARES = (0.3, 0.7)  # of the later pushes, between which the change comes


@dataclass(frozen=True)
class Row:
    """The alarm on one recording.

    change: the push before which the change came, None without one. fired: number of pushes seen when the alarm fired,
    None if it did not; by: the score that fired. seconds: of the calibration.
    """

    seed: int
    rig: str
    pushes: int
    change: int | None
    fired: int | None
    by: str | None
    seconds: float

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
    """Print the table of all recordings."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args(arguments)
    rows: list[Row] = []
    for seed in range(options.seeds):
        rows += rows_of(seed)
        print(f"\r{seed + 1} of {options.seeds}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    if options.json:
        options.json.write_text(json.dumps([asdict(row) for row in rows], indent=1) + "\n")
    text = markdown_of(rows)
    if options.markdown:
        options.markdown.write_text(text)
    print(text)
    return 0


def rows_of(seed: int) -> list[Row]:
    """Rows of the recordings of one seed, without and with the change."""
    model, plain, changed, change = case_of(seed)
    begin = time.process_time()
    calibration = calibrate(model)
    seconds = time.process_time() - begin
    rig = f"{model.rig.shape} on {model.rig.surface}"
    found = []
    for table, at in ((plain, None), (changed, change)):
        state = state_of(model, calibration, table)
        fired = state.fired_after, state.fired_by
        found.append(Row(seed, rig, state.pushes, at, *fired, seconds))
    return found


def case_of(seed: int) -> tuple[PushModel, PushTable, PushTable, int]:
    """A model, the windows of later pushes without and with a change, and the push before which it comes."""
    rng = np.random.default_rng([seed, 7])
    rig = rig_of(rng, f"{seed}", TRAINING)
    plain, other = (later_spec(rig, rng, LATER) for _ in range(2))
    change = int(rng.integers(round(SHARES[0] * LATER), round(SHARES[1] * LATER)))
    rise = Changes(contact_friction=partial(_risen, change))
    model = train_model(
        table_of(rig),
        simulated_rig(rig),
        "vhgp",
        name=f"{seed}",
        options=TrainingOptions(n_train=ROWS, seed=seed, mean="zero"),
    )
    return model, table_of(plain), table_of(replace(other, changes=rise)), change


def _risen(change: int, moment: Moment) -> Array:
    return np.where(moment.conditions.values["push_index"] >= change, RISE, 0.0)


def table_of(spec: SimulationSpec) -> PushTable:
    """Simulate a recording and find its windows."""
    return windows_to_table(find_windows(simulate(spec), simulated_rig(spec)))


def state_of(model: PushModel, calibration: Calibration, table: PushTable) -> AlarmState:
    """The state of the alarm after all pushes of a table."""
    prediction = model.predict_rows(table.inputs, table.duration, table.covariates)
    return alarm_state(calibration, table, prediction.mean, prediction.covariance)


def markdown_of(rows: Sequence[Row]) -> str:
    """The table for the documentation, with counts and 95 % Wilson intervals."""
    plain, changed = ([row for row in rows if (row.change is None) is without] for without in (True, False))
    lines = ["| recordings of 300 pushes | count | of | 95 % interval |", "| --- | --- | --- | --- |"]
    lines.append(_line("false alarms, recordings without a change", sum(r.false for r in plain), len(plain)))
    lines.append(_line("false alarms, before the change", sum(r.false for r in changed), len(changed)))
    delays = sorted(row.delay for row in changed if row.delay is not None)
    lines.append(_line("changes detected before the end", len(delays), len(changed)))
    if delays:
        lines.append(f"\nPushes until the alarm: {', '.join(map(str, delays))}; median {np.median(delays):g}.")
    seconds = [row.seconds for row in rows]
    lines.append(f"Calibration: {min(seconds):.1f} to {max(seconds):.1f} s of one core.")
    return "\n".join(lines) + "\n"


def _line(what: str, count: int, of: int) -> str:
    low, high = wilson(count, of)
    return f"| {what} | {count} | {of} | {low:.2f} to {high:.2f} |"


if __name__ == "__main__":
    sys.exit(main())

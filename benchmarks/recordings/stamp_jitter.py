# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0
"""Accuracy of a model on a recording whose stamps have jitter, with and without regular stamps in their place.

    python -m benchmarks.recordings.stamp_jitter [--model FILE] [--seeds 3] [--no-alarm]

The model is trained on bags/square_abs_train unless a file is given, and validated on bags/square_abs_test. Each stream
gets jitter of its own, independent from sample to sample: Gaussian, or a delay (half-normal) with the same scale.
Prints, for each jitter, the mean over the seeds of pushes, windows, NMSE and exact NLPD, the
alarm's largest log10 evidence at the end, and how often it fired.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from push_predictor.evaluation.alarm.scores import Calibration, alarm_state, calibrate
from push_predictor.evaluation.validation import compare, metrics_json
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.windows import regular_stamps
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table

TRAINING, TEST = Path("bags/square_abs_train"), Path("bags/square_abs_test")
SCALES = (1e-3, 2e-3, 4e-3)  # s
KINDS = ("gaussian", "half-normal")


def with_jitter(recording: Recording, kind: str, scale: float, rng: np.random.Generator) -> Recording:
    """The recording with jitter (scale in s) in the stamps of every stream; samples keep their order."""

    def noisy(stream: Any) -> Any:
        noise = scale * rng.standard_normal(len(stream))
        noise = np.abs(noise) if kind == "half-normal" else noise
        return replace(stream, stamp=stream.stamp + np.rint(1e9 * noise).astype(np.int64))

    wrench = None if recording.wrench is None else noisy(recording.wrench)
    return replace(recording, slider=noisy(recording.slider), pusher=noisy(recording.pusher), wrench=wrench)


@contextmanager
def raw_stamps() -> Iterator[None]:
    """No stamp is replaced."""
    share, regular_stamps.SHARE = regular_stamps.SHARE, np.inf
    try:
        yield
    finally:
        regular_stamps.SHARE = share


def scores(model: PushModel, recording: Recording, calibration: Calibration | None) -> list[float]:
    """Pushes, windows, NMSE, NLPD, and log10 evidence of the alarm at the end and whether it fired."""
    table = windows_to_table(find_windows(recording, require_rig(recording)))
    comparison = compare(model, table)
    metrics: dict[str, Any] = metrics_json(comparison)
    found = [float(len(table.pushes)), float(len(table)), metrics["nmse"]["total"], metrics["nlpd"]["total"]]
    if calibration is None:
        return [*found, np.nan, np.nan]
    state = alarm_state(calibration, table, comparison.mean, comparison.covariance)
    return [*found, state.log10_evidence, float(state.fired)]


def main() -> None:
    """Train or load the model, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--no-alarm", action="store_true")
    given = parser.parse_args()
    model = load_model(given.model) if given.model else _trained()
    calibration = None if given.no_alarm else calibrate(model)
    recording = read_recording(TEST)
    print("jitter ms, stamps, pushes, windows, NMSE, NLPD, largest log10 evidence, alarms")
    _line("0", "as recorded", [scores(model, recording, calibration)])
    for kind in KINDS:
        for scale in SCALES:
            noisy = [with_jitter(recording, kind, scale, np.random.default_rng(seed)) for seed in range(given.seeds)]
            with raw_stamps():
                _line(f"{kind} {1e3 * scale:g}", "raw", [scores(model, each, calibration) for each in noisy])
            _line(f"{kind} {1e3 * scale:g}", "regular", [scores(model, each, calibration) for each in noisy])


def _line(jitter: str, stamps: str, found: list[list[float]]) -> None:
    pushes, windows, nmse, nlpd, strongest, fired = np.array(found).T
    spread = f"{nmse.mean():.4f} ({nmse.min():.4f} to {nmse.max():.4f})"
    alarm = f"{strongest.max():.2f}, {fired.sum():.0f} of {len(found)}"
    print(
        f"{jitter}, {stamps}, {pushes.mean():.0f}, {windows.mean():.0f}, {spread}, {nlpd.mean():.3f}, {alarm}",
        flush=True,
    )


def _trained() -> PushModel:
    return train_model(
        load_data([TRAINING]), load_rig_for([TRAINING]), "vhgp", name="square", options=TrainingOptions(mean="zero")
    )


if __name__ == "__main__":
    main()

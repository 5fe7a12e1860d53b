# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Rollouts of long pushes compared with repetitions of the same pushes on the rig simulator.

    python -m benchmarks.planning.rollout [--model FILE] [--repeats 200] [--picture PICTURE.png]

Three predicted distributions of the slider's pose at the end of a push:

  rollout      samples, with the noise that persists within a push (planning/persistence.py)
  independent  samples with independent windows
  naive        one Gaussian: the path of the means, and the sum of the covariances along it

Compared by energy distance (heading times the slider's radius of gyration) and coverage of the 95 % ellipsoid.
Intervals: 95 %, from resampling repetitions.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from benchmarks.planning.rollout_picture import draw_rollout
from benchmarks.planning.rollout_truth import EnergyDistance, Repeats, covered, in_turn, repeats, weights_of
from benchmarks.support.scripts import parser_of, piped, ruled
from examples.plan_around_obstacles import TRAINING
from push_predictor.evaluation.estimate import of_draws
from push_predictor.geometry.touch import covariance_in_world, displaced
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.models.tabulated.tabulated_model import TabulatedModel, tabulate
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.planning.particles import windows_of
from push_predictor.planning.persistence import INDEPENDENT
from push_predictor.planning.rollout import rollout
from push_predictor.planning.straight_drive import start_drive
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.types import Array

SPEED, LENGTHS = 0.02, (0.06, 0.1)  # m/s; distances (m) after which poses are compared
CONTACTS, ANGLES = (0.03, 0.08, 0.125, 0.15, 0.2), (-0.5, 0.0, 0.4)
ARM = 0.09 / np.sqrt(6.0)  # m, of the square
SAMPLES = 2000
MILLIMETRES = 1e3
IN_TURN = 0  # of LENGTHS: the length of the successive pushes

Steps: TypeAlias = Sequence[Sequence[float]]  # velocity m/s, contact, angle rad, duration s


def main() -> int:
    """Simulate, roll out, print the table."""
    options = _arguments()
    model = load_model(options.model) if options.model else trained()
    tabulated = tabulate(model)
    print(f"{model.name}: {model.kind}, {len(model.training)} windows; {tabulated.how}")
    print(ruled("| distance | distribution | energy distance, mm | over rollout | 95 % ellipsoid covers |"))
    pushes = [(contact, angle) for contact in CONTACTS for angle in ANGLES]
    seen = [_repeated(k, *push, options.repeats) for k, push in enumerate(pushes)]
    for place, length in enumerate(LENGTHS):
        steps = [[[SPEED, *push, length / SPEED]] for push in pushes]
        _report(tabulated, f"{1e3 * length:.0f} mm", steps, [each.poses[place] for each in seen])
    singles = [[SPEED, *push, LENGTHS[IN_TURN] / SPEED] for push in pushes]
    sequences = np.random.default_rng(0).permutation(len(pushes)).reshape(-1, 3)
    truth = [in_turn([seen[k].poses[IN_TURN] for k in sequence]) for sequence in sequences]
    steps = [[singles[k] for k in sequence] for sequence in sequences]
    _report(tabulated, f"three pushes of {1e3 * LENGTHS[IN_TURN]:.0f} mm", steps, truth)
    if options.picture:
        draw_rollout(tabulated, options.picture)
    return 0


def trained() -> PushModel:
    """A VHGP of the training recording, without mechanics."""
    options, rig = TrainingOptions(mean="zero"), load_rig_for([TRAINING])
    return train_model(load_data([TRAINING]), rig, "vhgp", name="square_abs", options=options)


def _repeated(number: int, contact: float, angle: float, count: int) -> Repeats:
    print(f"simulating push {number + 1}, {count} times", file=sys.stderr)
    return repeats(contact, angle, SPEED, np.array(LENGTHS) / SPEED, count, 1000 + number)


def _report(tabulated: TabulatedModel, title: str, cases: Sequence[Steps], truth: Sequence[Array]) -> None:
    weights = weights_of(len(truth[0]))
    first: Array | None = None
    for name, distribution in DISTRIBUTIONS.items():
        samples = [distribution(tabulated, steps) for steps in cases]
        energies = [EnergyDistance(s, t, ARM) for s, t in zip(samples, truth, strict=True)]
        drawn = MILLIMETRES * np.mean([[e.value(w) for w in weights] for e in energies], axis=0)
        energy = of_draws(MILLIMETRES * float(np.mean([e.value() for e in energies])), drawn)
        first = drawn if first is None else first
        ratio = of_draws(float(np.median(drawn / first)), drawn / first)
        inside = np.mean([covered(s, t) for s, t in zip(samples, truth, strict=True)])
        print(piped([title, name, energy.text(".3f"), ratio.text(".2f"), f"{inside:.3f}"]), flush=True)


def _rolled(tabulated: TabulatedModel, steps: Steps) -> Array:
    return rollout(tabulated, np.zeros(3), np.zeros((3, 3)), np.array(steps), SAMPLES).samples


def _independent(tabulated: TabulatedModel, steps: Steps) -> Array:
    return rollout(tabulated, np.zeros(3), np.zeros((3, 3)), np.array(steps), SAMPLES, persistence=INDEPENDENT).samples


def _naive(tabulated: TabulatedModel, steps: Steps) -> Array:
    """Samples of one Gaussian along the path of the means."""
    slider, covariance = np.zeros((1, 3)), np.zeros((3, 3))
    for step in steps:
        slider, added = _step_of_means(tabulated, slider, step)
        covariance += added
    return np.random.default_rng(0).multivariate_normal(slider[0], covariance, SAMPLES)


def _step_of_means(tabulated: TabulatedModel, slider: Array, step: Sequence[float]) -> tuple[Array, Array]:
    """The slider (1, 3) after the mean displacements of a step, and the sum of their covariances (3, 3)."""
    rig, windows, covariance = tabulated.model.rig, windows_of(tabulated.model, step[3]), np.zeros((3, 3))
    drive, meeting = start_drive(rig.outline, rig.pusher_radius, slider, np.array([step[:3]]))
    for window in range(windows.count):
        if window:
            meeting = drive.contact_at(slider, meeting, window * windows.duration, windows.duration)
        if not meeting.in_contact[0]:
            break
        prediction = tabulated.predict_rows(meeting.touch.inputs, np.array([windows.asked]))
        slider = displaced(slider, meeting.touch.heading, meeting.share[:, None] * windows.scale * prediction.mean)
        covariance += covariance_in_world(prediction.covariance, meeting.touch.heading)[0]
    return slider, covariance


DISTRIBUTIONS: dict[str, Callable[[TabulatedModel, Steps], Array]] = {
    "rollout": _rolled,
    "independent": _independent,
    "naive": _naive,
}


def _arguments() -> argparse.Namespace:
    parser = parser_of(__doc__)
    parser.add_argument("--model", type=Path, help="a model file of the square on ABS (default: train one)")
    parser.add_argument("--repeats", type=int, default=200, help="repetitions of each push (default 200)")
    parser.add_argument("--picture", type=Path, help="also draw a push with two modes")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())

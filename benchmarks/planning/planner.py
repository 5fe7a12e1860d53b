# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The value of knowing the covariance of a push for a planner: goals reached on the simulated rig.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.planning.planner [--goals N] [--model FILE] [--probability P]

The planner (planning/choose.py), the pushes and the means are the same; only the covariance differs. Variants: the
model's own; the same for every window (the mean over the training windows), growing along a push as the model's does;
the same for every push (the mean over the pushes); and none. Goals, start poses and the noise of each push are drawn
once for all. Prints every regime below. The model is one of bags/square_abs_train, recorded on the simulated rig used
here.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.planning.planner_table import Regime, Runs, table
from push_predictor.models.prediction import Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.models.tabulated.tabulated_model import TabulatedModel, tabulate
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.planning.choose import Choice, choose_push
from push_predictor.planning.goal import Goal
from push_predictor.planning.model_repertoire import candidate_pushes, persistent_fraction
from push_predictor.planning.repertoire import Repertoire, repertoire
from push_predictor.planning.unscented import Predict, PusherGeometry
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.simulation.interactive_rig import push_once
from push_predictor.simulation.pushes import PushPlan
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array, TextArray

TRAINING = Path(__file__).resolve().parents[2] / "bags" / "square_abs_train"
WINDOW = 0.2  # s
VELOCITY = 0.02  # m/s, of most of the training pushes
WINDOWS = (1, 2, 3, 4, 5, 6, 8)  # 4 to 32 mm
VARIANTS = ("VHGP", "same for every window", "same for every push", "none")
SEED = 2026
AREA = 0.12  # m, half the side of the square on the table in which sliders start
IDLE = (0.125, 0.0, 0.001)  # contact, angle, travel of the push on a slider at its goal; its outcome is ignored


REGIMES = (
    Regime("near, tight", 0.02, 0.3, 0.001, 0.03),
    Regime("near, any heading", 0.025, 0.0, 0.001, None),
    Regime("far, tight", 0.06, 0.6, 0.001, 0.03),
    Regime("far, middling", 0.06, 0.6, 0.002, 0.05),
    Regime("far, loose", 0.06, 0.6, 0.004, 0.1),
    Regime("far, any heading", 0.06, 0.0, 0.002, None),
)


def main(arguments: list[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--goals", type=int, default=100, help="of every regime")
    parser.add_argument("--model", type=Path, help="a model of bags/square_abs_train (default: train one)")
    parser.add_argument(
        "--probability", type=float, default=0.9, help="wanted probability that a push reaches the goal"
    )
    parser.add_argument("--regimes", nargs="*", help="names; all unless given")
    options = parser.parse_args(arguments)
    model = load_model(options.model) if options.model else trained()
    repertoires = repertoires_of(tabulate(model))
    count = len(repertoires[VARIANTS[0]])
    print(f"{count} pushes to choose from; {options.goals} goals; probability {options.probability}\n")
    for regime in REGIMES:
        if not options.regimes or regime.name in options.regimes:
            begun = time.monotonic()
            runs = {name: run(r, regime, options.goals, options.probability) for name, r in repertoires.items()}
            print(table(regime, runs), flush=True)
            print(f"{regime.name}: {time.monotonic() - begun:.0f} s", file=sys.stderr)
    return 0


def repertoires_of(tabulated: TabulatedModel) -> dict[str, Repertoire]:
    """A repertoire per variant: the model's pushes and means, and the covariance of the variant."""
    model = tabulated.model

    def predict(inputs: Array) -> Prediction:
        return tabulated.predict_rows(inputs, np.full(len(inputs), WINDOW))

    typical = model.predict_rows(model.training.inputs, model.training.duration).covariance.mean(axis=0)
    persistent = persistent_fraction(model, VELOCITY * WINDOW)
    tip = PusherGeometry(model.rig.outline, model.rig.pusher_radius, WINDOW)
    lines = candidate_pushes(model.rig.outline, VELOCITY)
    own = repertoire(predict, tip, lines, WINDOWS, persistent)
    constant = repertoire(_with_covariance(predict, typical), tip, lines, WINDOWS, persistent)
    keys = np.intersect1d(_keys(own), _keys(constant))
    own, constant = _only(own, keys), _only(constant, keys)
    every = np.tile(own.covariance.mean(axis=0), (len(own), 1, 1))
    covariances = own.covariance, constant.covariance, every, np.zeros_like(every)
    return {name: replace(own, covariance=of) for name, of in zip(VARIANTS, covariances, strict=True)}


def run(pushes: Repertoire, regime: Regime, count: int, probability: float) -> Runs:
    """Push `count` sliders to their goals, in lockstep."""
    sliders, goals = _drawn(regime, count)
    needed = np.full(count, regime.limit + 1)
    promised, kept = [], []
    for turn in range(regime.limit):
        waiting = np.flatnonzero(needed > regime.limit)
        choices = {int(k): choose_push(pushes, sliders[k], goals[k], probability) for k in waiting}
        chosen = {k: choice for k, choice in choices.items() if choice is not None}
        after = push_once(_spec(chosen, count, turn), sliders)
        sliders[waiting] = after[waiting]
        for k, choice in chosen.items():
            there = bool(goals[k].reached(goals[k].ahead(sliders[k])))
            needed[k] = turn + 1 if there else needed[k]
            if choice.probability >= probability:
                promised.append(choice.probability)
                kept.append(there)
    error = np.array([np.hypot(*goal.ahead(slider)[:2]) for goal, slider in zip(goals, sliders, strict=True)])
    return Runs(needed, error, np.array(promised), np.array(kept, dtype=np.bool_))


def _drawn(regime: Regime, count: int) -> tuple[Array, list[Goal]]:
    """Draw sliders (n, 3) and their goals, the same for every variant."""
    rng = np.random.default_rng([SEED, REGIMES.index(regime)])
    sliders = np.column_stack([rng.uniform(-AREA, AREA, (count, 2)), rng.uniform(-np.pi, np.pi, count)])
    distance, toward = regime.far * rng.uniform(0.25, 1.0, count), rng.uniform(-np.pi, np.pi, count)
    turned = rng.uniform(-regime.turned, regime.turned, count)
    shift = np.column_stack([distance * np.cos(toward), distance * np.sin(toward), turned])
    return sliders, [Goal(pose, regime.distance, regime.turn) for pose in sliders + shift]


def _spec(chosen: Mapping[int, Choice], count: int, turn: int) -> SimulationSpec:
    """The chosen pushes, each in the row of its goal, so that a row has the same noise for all variants."""
    rows = np.tile(np.array([*IDLE[:2], VELOCITY, IDLE[2]]), (count, 1))
    for k, choice in chosen.items():
        velocity, contact, angle = choice.push.inputs[0]
        rows[k] = contact, angle, velocity, velocity * WINDOW * choice.push.windows[0]
    return SimulationSpec("rect1", "abs", PushPlan(*rows.T), seed=SEED + turn)


def _keys(of: Repertoire) -> TextArray:
    """Keys of the pushes of a repertoire."""
    return np.array(
        [f"{inputs.tobytes().hex()} {count}" for inputs, count in zip(*vars(of.pushes).values(), strict=True)]
    )


def _only(of: Repertoire, keys: TextArray) -> Repertoire:
    """The pushes with these keys, in their order."""
    rows = np.argsort(every := _keys(of))[np.searchsorted(np.sort(every), keys)]
    return Repertoire(of.pushes.take(rows), of.mean[rows], of.covariance[rows])


def _with_covariance(predict: Predict, covariance: Array) -> Predict:
    def constant(inputs: Array) -> Prediction:
        return replace(predict(inputs), covariance=np.tile(covariance, (len(inputs), 1, 1)))

    return constant


def trained() -> PushModel:
    """Train a VHGP on the recording."""
    return train_model(
        load_data([TRAINING]),
        load_rig_for([TRAINING]),
        "vhgp",
        name="vhgp",
        sources=[TRAINING.name],
        options=TrainingOptions(tails=False, mean="zero"),
    )


if __name__ == "__main__":
    sys.exit(main())

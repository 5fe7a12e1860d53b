# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The recordings of the blind benchmark: a rig, a model trained on it, a later recording with a hidden effect."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.blind.effects import GROUPS, HUMIDITY, SIZES, TEMPERATURE, Drawn, World, draw, undisturbed, with_second
from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.models.train_learnt import MeanChoice
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.recordings.write import write_recording
from push_predictor.simulation.batches import conditions_of, end_times
from push_predictor.simulation.changes import Changes, Conditions, Topic
from push_predictor.simulation.physics import GRAVITY
from push_predictor.simulation.pushes import PushPlan, pusher_path
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.simulation.spec import PUSHER_RADIUS, SimulationSpec, simulated_rig, start_poses

SHAPES = ("rect1", "rect1", "rect1", "ellip2", "hex")
SURFACES = ("abs", "delrin", "plywood", "pu")
SPEEDS = (0.01, 0.02, 0.03)  # m/s, slow enough that inertia hardly counts
WINDOWS, WINDOW = (3.2, 4.4), 0.2  # windows a push, s
TURN_SPREAD, PLACE_SPREAD = 3.0, 0.05  # rad, m: sliders have all headings
MEAN_PAUSE, LONG_BREAKS, LONG_BREAK = 0.6, 2, 40.0  # s: they separate time, push count and dwell time
TWO_EFFECTS = 0.26  # share of the library's group with a second effect: a fifth of all effects on the motion
MODEL = "model.json"


@dataclass(frozen=True)
class Size:
    """Pushes to train on, range of the number of new pushes, training rows, kind of model and of its mean."""

    training: int = 500
    least: int = 170
    most: int = 600
    rows: int = 1000
    kind: str = "vhgp"
    mean: MeanChoice = "auto"


def make_one(number: int, group: str, seed: int, size: Size, out: Path, truth: Path) -> Drawn:
    """Simulate recording `number` of a group (none or one of GROUPS) into out/NNN, its truth into truth/NNN.json."""
    plain, later, drawn = drawn_recording(number, group, seed, size)
    folder = out / f"{number:03d}"
    table = windows_of(replace(plain, name="training"))
    folder.mkdir(parents=True, exist_ok=True)
    write_recording(folder / "new", simulate(later))
    rows = min(size.rows, len(table))
    options = TrainingOptions(n_train=rows, seed=seed, mean=size.mean)
    model = train_model(table, simulated_rig(plain), size.kind, name=f"{number:03d}", options=options)
    save_model(model, folder / MODEL)
    known = {"number": number, "group": group, "seed": seed, "shape": plain.slider.name, "surface": plain.table.name}
    known |= {"friction": plain.table.friction, "pushes": len(later.pushes)}
    (truth / f"{number:03d}.json").write_text(json.dumps({**known, **drawn.described()}, indent=1))
    return drawn


def windows_of(spec: SimulationSpec) -> PushTable:
    """The windows of a simulated recording."""
    return windows_to_table(find_windows(simulate(spec), simulated_rig(spec)))


def drawn_recording(number: int, group: str, seed: int, size: Size) -> tuple[SimulationSpec, SimulationSpec, Drawn]:
    """The training recording without its effect, the later one with it, and the effect; the same in every call."""
    rng = np.random.default_rng([seed, number])
    plain = rig_of(rng, f"{number:03d}", size.training)
    later = later_spec(plain, rng, int(rng.integers(size.least, size.most + 1)))
    drawn = drawn_for(later, group, rng)
    acting = {"changes": drawn.act} if isinstance(drawn.act, Changes) else {"faults": drawn.act}
    return plain, replace(later, name="new", **acting), drawn


def rig_of(rng: np.random.Generator, name: str, pushes: int) -> SimulationSpec:
    """Draw a rig and its training recording."""
    spec = SimulationSpec(
        str(rng.choice(SHAPES)),
        str(rng.choice(SURFACES)),
        pushes_of(rng, pushes),
        seed=int(rng.integers(2**31)),
        surface_seed=int(rng.integers(2**31)),
        slider_seed=int(rng.integers(2**31)),
        name=name,
        place_spread=PLACE_SPREAD,
        turn_spread=TURN_SPREAD,
    )
    return with_pauses_and_topics(spec, rng)


def later_spec(plain: SimulationSpec, rng: np.random.Generator, pushes: int) -> SimulationSpec:
    """A later recording of the same rig: other pushes, pauses, noise and topics."""
    return with_pauses_and_topics(replace(plain, pushes=pushes_of(rng, pushes), seed=int(rng.integers(2**31))), rng)


def pushes_of(rng: np.random.Generator, n: int) -> PushPlan:
    """Pushes of three to four windows at several speeds from all sides."""
    speed = rng.choice(SPEEDS, n)
    travel = rng.uniform(*WINDOWS, n) * WINDOW * speed + 0.002
    return PushPlan(rng.random(n), rng.uniform(-1.2, 1.2, n), speed, travel)


def with_pauses_and_topics(spec: SimulationSpec, rng: np.random.Generator) -> SimulationSpec:
    """The spec with pauses between its pushes and two drifting scalar topics."""
    n = len(spec.pushes)
    pauses = rng.exponential(MEAN_PAUSE, n)
    pauses[rng.integers(n, size=LONG_BREAKS)] += LONG_BREAK
    lasts = float(conditions(replace(spec, pauses=pauses)).values["elapsed_time"][-1]) + 10.0
    time = np.linspace(0.0, lasts, 400)
    topics = {
        TEMPERATURE: Topic(time, 22.0 + wander(rng, 1.5, len(time)), 0.02),
        HUMIDITY: Topic(time, 45.0 + wander(rng, 5.0, len(time)), 0.1),
    }
    return replace(spec, pauses=pauses, topics=topics)


def wander(rng: np.random.Generator, size: float, n: int) -> np.ndarray:
    """A random walk of n steps with a range of 3 `size`."""
    walk = np.cumsum(rng.standard_normal(n))
    return np.asarray(3.0 * size * (walk - walk.mean()) / np.ptp(walk))


def conditions(spec: SimulationSpec) -> Conditions:
    """The conditions at the start of each push of a spec."""
    start = start_poses(spec)
    path = pusher_path(spec.pushes, spec.slider.outline, PUSHER_RADIUS, start, spec.acceleration)
    return conditions_of(spec, start, path, end_times(path, spec.table.friction))


def drawn_for(spec: SimulationSpec, group: str, rng: np.random.Generator) -> Drawn:
    """Draw an effect of a group for this recording."""
    if group == "none":
        return undisturbed()
    world = World(spec.slider.outline, spec.slider.mass * GRAVITY, spec.table.friction, conditions(spec), rng)
    kinds = GROUPS[group]
    drawn = draw(kinds[int(rng.integers(len(kinds)))], str(rng.choice(SIZES)), world)
    return with_second(drawn, world) if group == "library" and rng.random() < TWO_EFFECTS else drawn

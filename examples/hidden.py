# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A recording during which the rig changes; a seed draws the change from the effects of the blind benchmark.

Slider, table and sensors are those of bags/square_abs_train. The first pushes are as in training, then the change sets
in. A separate file holds what was drawn; the demo reads it only at the end.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.blind.effects import GROUPS, World, draw
from benchmarks.blind.recordings import conditions
from push_predictor.recordings.streams import Recording, taken
from push_predictor.recordings.write import write_recording
from push_predictor.simulation.changes import Changes, Law, Moment
from push_predictor.simulation.physics import GRAVITY
from push_predictor.simulation.pushes import random_pushes
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.simulation.standard_bags import SPEEDS, TRAVEL, standard_bags

GROUP, SIZE = "library", "large"
PLAIN, TRACED, REST = 25, 150, 80  # pushes: before the effect, with it until the trace, after the trace


@dataclass(frozen=True)
class Hidden:
    """Paths. recorded: the pushes before the trace; whole: those and the later ones; truth: what was drawn."""

    recorded: Path
    whole: Path
    truth: Path


def make_hidden(folder: Path, seed: int) -> Hidden:
    """Draw a change, simulate, write both recordings and, in another folder, the truth."""
    places = Hidden(folder / "changed", folder / "changed_whole", folder / "truth" / "hidden.json")
    rng = np.random.default_rng([seed, 7])
    plain = standard_bags()["square_abs_train"]
    pushes = random_pushes(PLAIN + TRACED + REST, SPEEDS, TRAVEL, rng)
    spec = replace(plain, pushes=pushes, seed=int(rng.integers(2**31)), name=places.whole.name)
    act, truth = _drawn(spec, rng)
    whole = simulate(replace(spec, changes=act))
    begins = conditions(spec).values["elapsed_time"]
    write_recording(places.whole, whole)
    write_recording(places.recorded, until(whole, float(begins[PLAIN + TRACED])))
    places.truth.parent.mkdir(parents=True, exist_ok=True)
    places.truth.write_text(json.dumps(truth, indent=1))
    return places


def _drawn(spec: SimulationSpec, rng: np.random.Generator) -> tuple[Changes, Mapping[str, Any]]:
    """A constant change from push PLAIN on, and its description for the reader."""
    world = World(spec.slider.outline, spec.slider.mass * GRAVITY, spec.table.friction, conditions(spec), rng)
    kinds = GROUPS[GROUP]
    kind = replace(kinds[int(rng.integers(len(kinds)))], drivers=("constant",), alone=1.0)
    drawn = draw(kind, SIZE, world)
    assert isinstance(drawn.act, Changes)  # this group has no measurement errors
    truth = {"mechanism": drawn.kind, "value": drawn.value, "unit": drawn.unit, "size": SIZE, "from push": PLAIN}
    return _later(drawn.act), {**truth, "right names": drawn.names}


def _later(changes: Changes) -> Changes:
    """The same changes from push PLAIN on; none before."""
    laws = {f.name: getattr(changes, f.name) for f in fields(changes) if f.name != "added_mass"}
    gated: dict[str, Any] = {name: _gated(law) for name, law in laws.items() if law is not None}
    return replace(changes, **gated)


def _gated(law: Law) -> Law:
    def gated(moment: Moment) -> np.ndarray:
        value = np.asarray(law(moment))
        on = moment.conditions.row >= PLAIN
        return np.where(on.reshape(-1, *[1] * (value.ndim - 1)), value, 0.0)

    return gated


def until(recording: Recording, seconds: float) -> Recording:
    """The first seconds of a recording."""
    first = min(int(recording.slider.stamp[0]), int(recording.pusher.stamp[0]))
    last = first + round(seconds * 1e9)
    slider, pusher = (taken(stream, stream.stamp <= last) for stream in (recording.slider, recording.pusher))
    wrench = None if recording.wrench is None else taken(recording.wrench, recording.wrench.stamp <= last)
    return replace(recording, slider=slider, pusher=pusher, wrench=wrench)

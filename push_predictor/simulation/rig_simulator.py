# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Simulate recordings: from a plan of pushes to the streams of the sensors."""

from __future__ import annotations

import hashlib

import numpy as np

from push_predictor.recordings.streams import Recording, ScalarStream
from push_predictor.simulation.batches import Batch, run_pushes
from push_predictor.simulation.outcomes import push_outcomes
from push_predictor.simulation.pushes import PushPlan, grid_pushes, random_pushes
from push_predictor.simulation.sensors import (
    Sensors,
    feel_wrench,
    record_topic,
    surface_temperature,
    track_pusher,
    track_slider,
)
from push_predictor.simulation.spec import SimulationSpec, simulated_rig
from push_predictor.simulation.timeline import PushMotion, Truth, run_in_turn
from push_predictor.watch import Watch, no_watch

__all__ = ["PushPlan", "Sensors", "SimulationSpec", "grid_pushes", "push_outcomes", "random_pushes", "simulate"]

TEMPERATURE_TOPIC = "surface/temperature"
FIRST_STAMP, STAMP_RANGE = 1_500_000_000, 10**8  # s since 1970


def simulate(spec: SimulationSpec, watch: Watch = no_watch) -> Recording:
    """The recording of a spec's pushes. Raises RigError for an unknown shape or surface.

    watch: called with the share of the pushes that is simulated.
    """
    motions: dict[int, PushMotion] = {}
    count = len(spec.pushes)
    for batch in run_pushes(spec):
        motions |= {row: _motion(batch, i) for i, row in enumerate(batch.rows.tolist())}
        watch(f"push {len(motions)} of {count}", len(motions) / count)
    truth = run_in_turn([motions[row] for row in range(count)], spec.pauses)
    epoch = _epoch(spec)
    return Recording(
        name=spec.name,
        rig=simulated_rig(spec),
        slider=track_slider(truth, spec.sensors, epoch, spec.rng(10), spec.faults),
        pusher=track_pusher(truth, spec.sensors, epoch, spec.rng(11), spec.faults),
        wrench=feel_wrench(truth, spec.sensors, epoch, spec.rng(12), spec.faults),
        scalars=_scalars(spec, truth, epoch),
    )


def _scalars(spec: SimulationSpec, truth: Truth, epoch: int) -> dict[str, ScalarStream]:
    """The scalar topics of the spec, and a temperature unless the spec defines that topic."""
    own = {TEMPERATURE_TOPIC: surface_temperature(truth, epoch, spec.rng(13))}
    given = [(name, spec.topics[name], spec.rng(14 + k)) for k, name in enumerate(sorted(spec.topics))]
    return own | {name: record_topic(topic, truth, epoch, rng) for name, topic, rng in given}


def _motion(batch: Batch, i: int) -> PushMotion:
    """Push i of a batch until its end, copied so that the batch can be freed."""
    motion = batch.motion
    stop = int(np.searchsorted(motion.time[i], batch.end[i], side="right"))
    streams = (motion.time, motion.slider, motion.pusher, motion.wrench)
    return PushMotion(*(stream[i, :stop].copy() for stream in streams))


def _epoch(spec: SimulationSpec) -> int:
    """Start stamp (ns), derived from the spec so that different recordings get different stamps."""
    plan = spec.pushes
    settings = (spec.slider.name, spec.table, spec.seed, spec.surface_seed, spec.sensors, spec.name)
    digest = hashlib.sha256(repr(settings).encode())
    for column in (plan.contact, plan.angle, plan.speed, plan.travel):
        digest.update(np.ascontiguousarray(column).tobytes())
    return (FIRST_STAMP + int.from_bytes(digest.digest()[:8], "big") % STAMP_RANGE) * 10**9

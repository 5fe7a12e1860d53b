# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Traces with known truth: pushes of the analytical model with a planted effect, and a trace that found it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any, Literal

import numpy as np
from synthetic import square_rig

from benchmarks.blind.oracle import gain
from push_predictor.evaluation.estimate import Estimate
from push_predictor.geometry.frames import wrap_angle
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.mechanics.fitted import FittedMechanics, analytical_mechanics
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import candidate
from push_predictor.residuals.evidence.input_shift import ShiftedInput
from push_predictor.residuals.evidence.standardised import digest_of, evidence_of, held_out_rows
from push_predictor.residuals.extension.extended_model import extend, refit_base
from push_predictor.residuals.extension.held_out_gain import compared
from push_predictor.residuals.outcome import FoundEffect, HeldOut, Sized, Tested, Trace, Verdict

NOISE = np.array([1e-4, 1e-4, 3e-3])
DRIFT = DriverBasis("linear", ("elapsed_time",), (500.0,), (300.0,))
JUMP = DriverBasis("step", ("elapsed_time",), place=620.0)
PLACE = DriverBasis("map", ("slider_x", "slider_y"), (0.0, 0.0), (0.1, 0.1))
GRAIN = ("anisotropic_friction", "push_heading", DriverBasis("constant"))
DRIVERS = ("elapsed_time", "push_index", "slider_x", "slider_heading", "push_heading", "topic:/warmth")
TESTED = tuple(
    Tested(mechanism, driver, float(p))
    for (mechanism, driver), p in zip(
        [(m, d) for m in ("contact_friction", "pressure_spread", "tilted_surface", None) for d in DRIVERS],
        np.linspace(0.001, 1.0, 24) ** 1.2,
        strict=True,
    )
)
DETECTABLE = {"contact_friction": {"value": 0.021, "unit": "1"}, "clock_offset": {"value": 0.004, "unit": "s"}}


def physics() -> FittedMechanics:
    rig = square_rig()
    return analytical_mechanics(rig.outline, rig.pusher_radius)


def pushes(count: int, seed: int, *effects: Effect) -> PushTable:
    """Pushes of three windows with these effects; the windows of a push share some noise."""
    rng = np.random.default_rng(seed)
    n = 3 * count
    contact, angle = rng.random(count), rng.uniform(-0.9, 0.9, count)
    contact = np.floor(4.0 * contact) / 4.0 + np.clip(contact % 0.25, 0.02, 0.23)
    jitter = rng.uniform(-1.0, 1.0, (n, 2)) * [0.01, 0.03]
    inputs = np.column_stack([np.full(n, 0.02), *(np.repeat([contact, angle], 3, axis=1) + jitter.T)])
    duration = np.full(n, 0.2)
    normal = physics().outline.inward_normal(inputs[:, 1])
    heading = np.repeat(rng.uniform(-np.pi, np.pi, count), 3)
    covariates = {
        "elapsed_time": np.repeat(np.linspace(0.0, 1000.0, count), 3),
        "push_index": np.repeat(np.arange(count, dtype=np.float64), 3),
        "slider_x": np.repeat(rng.uniform(-0.2, 0.2, count), 3),
        "slider_y": np.repeat(rng.uniform(-0.2, 0.2, count), 3),
        "slider_heading": heading,
        "push_heading": wrap_angle(heading + np.arctan2(normal[:, 1], normal[:, 0]) + inputs[:, 2]),
        "edge": np.floor(4.0 * inputs[:, 1]),
    }
    shared = np.repeat(rng.standard_normal((count, 3)), 3, axis=0)
    outcomes = physics().displacement(inputs, duration) + NOISE * (0.5 * shared + rng.standard_normal((n, 3)))
    push = Push(inputs, duration, covariates)
    shift = joint_shift(physics(), effects, push)
    push_id = np.array([f"{seed}-{k // 3}" for k in range(n)])
    return PushTable(inputs, duration, outcomes + shift, push_id, covariates)


def planted(mechanism: str | None, covariate: str, basis: DriverBasis, *coefficients: float) -> Effect:
    """An effect of exactly this size."""
    size = np.array(coefficients)
    return Effect(mechanism, covariate, basis, size, np.zeros((len(size), len(size))), np.ones(3))


def slippery(size: float) -> Effect:
    """A contact friction that changes by `size` in 300 s."""
    return planted("contact_friction", "elapsed_time", DRIFT, size)


def made_up_trace(*effects: Effect, count: int = 150, **other: Any) -> Trace:
    """A trace that found exactly these effects; other: fields to replace."""
    model = train_model(
        pushes(60, 1), square_rig(), "analytical", name="deployed", options=TrainingOptions(mean="zero")
    )
    table = pushes(count, 2, *effects)
    held = held_out_rows(table)
    return replace(traced(model, table.take(~held), table.take(held), effects), **other)


def traced(model: PushModel, analysis: PushTable, held: PushTable, effects: tuple[Effect, ...]) -> Trace:
    """The trace that finds these effects."""
    refit = refit_base(model, analysis)
    evidence = evidence_of(model, analysis)
    candidates = [candidate(evidence, e.mechanism, e.covariate, e.basis) for e in effects]
    after = extend(refit, evidence, candidates) if effects else refit
    terms = after.predictor.effects
    nmse, nlpd = gain(refit, after, held, model.training_mean) if terms else (Estimate(0.0, 0.0, 0.0),) * 2
    before, again, last = (compared(m, held, model.training_mean) for m in (model, refit, after))
    return Trace(
        verdict="effect" if terms else "none",
        kind="mean" if terms else None,
        model=model,
        effects=tuple(found(term) for term in terms),
        terms=terms,
        equivalent=(),
        mechanisms=(),
        undecided=False,
        analysis=analysis,
        residual=evidence.z,
        find_unexplained=lambda: evidence_of(after, analysis).z,
        held_out=HeldOut(held, before, again, last, digest_of(held)),
        gain_nmse=nmse,
        gain_nlpd=nlpd,
        gain_over="refit",
        extended=after if terms and nlpd.high < 0.0 else None,
        tested=TESTED if terms else tuple(replace(t, p_value=0.3 + 0.7 * t.p_value) for t in TESTED),
        minimum_detectable=DETECTABLE,
        remaining=None,
        alpha=0.01,
        notes=("a note for the reader",),
    )


def found(term: Effect) -> FoundEffect:
    """An effect as a trace reports it."""
    sd = float(np.sqrt(term.covariance[0, 0]))
    value = float(term.coefficients[0])
    size = Sized("change per 300 s", value, value - 1.96 * sd, value + 1.96 * sd, "1")
    parameter = None if term.mechanism is None else size
    return FoundEffect(term.mechanism, term.covariate, ("dy", "dtheta"), term.basis.name, parameter, 0.001, 0.23)


def without_motion_effect(verdict: Any, mechanism: str, covariate: str, size: Sized | None, **other: Any) -> Trace:
    """A trace whose finding does not change the motion model."""
    outputs = () if verdict in ("measurement", "wrench_only") else ("dy",)
    effect = FoundEffect(mechanism or None, covariate, outputs, "constant", size, 0.002, float("nan"))
    kind: Literal["mean", "variance"] = "variance" if verdict == "variance" else "mean"
    return replace(made_up_trace(count=60), verdict=verdict, effects=(effect,), kind=kind, **other)


LATE = Sized("lateness of the slider's stamps", 0.012, 0.0105, 0.0135, "s")
MORE = Sized("relative change of the force since training", 0.2, 0.1, 0.3, "1")
LOUDER = Sized("factor on the noise", 1.5, 1.3, 1.7, "1")
FASTER = ShiftedInput("velocity", (0.01, 0.05), (0.1, 0.15), 0.97)
SIDES = DriverBasis("category", ("edge",), levels=(0.0, 1.0, 2.0, 3.0))
UNKNOWN = [0.0] * 8 + [0.018] + [0.0] * 5 + [0.6] + [0.0] * 3  # dy and dtheta over the angle


def shifted(trace: Trace, verdict: Verdict = "input_shift") -> Trace:
    """A copy of a trace whose pushes were faster than those of training."""
    return replace(trace, verdict=verdict, input_shift=(FASTER,))


TRACES: dict[str, Callable[[], Trace]] = {
    "none": lambda: made_up_trace(count=90),
    "effect": lambda: made_up_trace(planted("contact_friction", "elapsed_time", JUMP, 0.15)),
    "constant": lambda: made_up_trace(planted("contact_friction", "model_inputs", DriverBasis("constant"), -0.08)),
    "two effects": lambda: made_up_trace(slippery(0.06), planted(*GRAIN, 0.1, 0.05)),
    "category": lambda: made_up_trace(planted("contact_friction", "edge", SIDES, 0.1, -0.1, 0.05)),
    "map": lambda: made_up_trace(planted("contact_friction", "slider_x", PLACE, 0.05, -0.03, 0, 0, 0)),
    "mechanism_only": lambda: made_up_trace(
        slippery(0.06), verdict="mechanism_only", equivalent=("push_index",), undecided=True
    ),
    "driver_only": lambda: made_up_trace(planted(None, "elapsed_time", DRIFT, *UNKNOWN), verdict="driver_only"),
    "wrench_only": lambda: without_motion_effect("wrench_only", "surface_friction", "model_inputs", MORE),
    "measurement": lambda: without_motion_effect("measurement", "clock_offset", "model_inputs", LATE),
    "variance": lambda: without_motion_effect("variance", "", "elapsed_time", LOUDER),
    "input_shift": lambda: shifted(made_up_trace(count=60)),
}


@cache
def trace_of(name: str) -> Trace:
    """The trace of this name in TRACES."""
    return TRACES[name]()

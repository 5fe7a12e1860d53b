# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The wrench channel: effects on the force of a push are found there, and only there."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.mechanics.fitted import analytical_mechanics
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.residuals.channels.contrast import (
    ChannelFinding,
    Quantity,
    along,
    best_and_rivals,
    searched,
    stacked,
)
from push_predictor.residuals.channels.wrench import log_load, wrench_effects
from push_predictor.residuals.evidence.drivers import standard_basis
from push_predictor.simulation.rig_simulator import SimulationSpec, random_pushes, simulate
from push_predictor.types import Array

MECHANICS = analytical_mechanics(shape_outline("rect1"), 0.00475, contact_friction=0.25)
PUSHES, WINDOWS = 120, 3  # per push
FMAX = 2.0  # N
SCATTER = 0.08  # of the logarithm of the force, by push and by window alike


@cache
def made(
    seed: int,
    *,
    drift: float = 0.0,
    level: float = 0.0,
    contact_friction: float = 0.25,
) -> PushTable:
    """Windows with the force of a limit surface: log fmax drifts and is shifted."""
    rng = np.random.default_rng(seed)
    n = PUSHES * WINDOWS
    push = np.repeat(np.arange(PUSHES), WINDOWS)
    contact, angle = rng.random(PUSHES)[push], rng.uniform(-1.0, 1.0, PUSHES)[push]
    heading = rng.uniform(-np.pi, np.pi, PUSHES)[push]
    noise = SCATTER * (rng.standard_normal(PUSHES)[push] + rng.standard_normal(n)) / np.sqrt(2.0)
    fmax = FMAX * np.exp(level + drift * (push / PUSHES - 0.5) + noise)
    force = predicted_force(contact, angle, contact_friction) * fmax[:, None]
    covariates = {
        "elapsed_time": push * 2.0 + np.tile(np.arange(WINDOWS) * 0.2, PUSHES),
        "push_heading": heading,
        "slider_x": rng.normal(0.0, 0.02, PUSHES)[push],
        "normal_force": force[:, 0],
        "tangential_force": force[:, 1],
        "topic:/hum": rng.standard_normal(PUSHES)[push],
    }
    inputs = np.column_stack([np.full(n, 0.02), contact, angle])
    return PushTable(inputs, np.full(n, 0.2), np.zeros((n, 3)), push.astype(np.str_), covariates)


def predicted_force(contact: Array, angle: Array, contact_friction: float) -> Array:
    """Force (n, 2) along the inward normal and its left per unit of fmax."""
    outline = MECHANICS.outline
    normal, arm = outline.inward_normal(contact), outline.point(contact) / MECHANICS.ellipsoid.length
    p = arm[:, 0] * normal[:, 1] - arm[:, 1] * normal[:, 0]
    q = arm[:, 0] * normal[:, 0] + arm[:, 1] * normal[:, 1]
    # Of the forces in the friction cone, the one whose velocity of the contact is nearest in direction to the pusher's.
    edge = np.arctan(contact_friction)
    tried = np.linspace(-edge, edge, 2001)
    fn, ft = np.cos(tried), np.sin(tried)
    moment = p[:, None] * fn + q[:, None] * ft
    of_contact = np.arctan2(ft + moment * q[:, None], fn + moment * p[:, None])
    best = np.argmin(np.abs(of_contact - angle[:, None]), axis=1)
    force = np.column_stack([fn[best], ft[best]])
    return force / np.sqrt(1.0 + moment[np.arange(len(best)), best] ** 2)[:, None]


def found(table: PushTable, baseline: PushTable | None) -> ChannelFinding:
    return wrench_effects(table, baseline, MECHANICS, alpha=0.002)


def test_load_does_not_depend_on_push_direction_or_contact_friction() -> None:
    """Every window determines the surface friction by itself."""
    for contact_friction in (0.1, 0.5):
        table = made(0, contact_friction=contact_friction)
        assert np.median(np.exp(log_load(table, MECHANICS))) == pytest.approx(FMAX, rel=0.02)


@pytest.mark.parametrize(("drift", "baseline"), [(0.2, made(1)), (-0.4, None)], ids=["against training", "alone"])
def test_drift_of_surface_friction_is_found_and_sized(drift: float, baseline: PushTable | None) -> None:
    effects = found(made(2, drift=drift), baseline).effects
    assert [(e.mechanism, e.covariate) for e in effects] == [("surface_friction", "elapsed_time")]
    size = effects[0].parameters[0]
    assert size.low < np.expm1(0.9 * drift) < size.high  # over the middle 90 % of the time
    assert size.unit == "1"


@pytest.mark.parametrize(("step", "place"), [(-0.5, 0.35), (0.2, 0.65)])
def test_step_of_surface_friction_is_a_step_of_its_size_and_sign(step: float, place: float) -> None:
    table = made(2)
    later = table.covariates["elapsed_time"] > 2.0 * place * PUSHES
    table = with_force(table, np.exp(step * later))
    (effect,) = found(table, made(1)).effects
    assert (effect.mechanism, effect.covariate, effect.basis) == ("surface_friction", "elapsed_time", "step")
    assert effect.parameters[0].low < np.expm1(step) < effect.parameters[0].high


@pytest.mark.parametrize("seed", [2, 5])
def test_drift_of_surface_friction_is_no_step(seed: int) -> None:
    """A step may fit better by chance; it must fit surely better."""
    (effect,) = found(made(seed, drift=0.15), made(1)).effects
    assert effect.basis == "linear"


def test_windows_with_a_gross_error_of_the_force_do_not_hide_a_drift() -> None:
    odd = np.where(np.arange(PUSHES * WINDOWS) % 60 == 7, 1e4, 1.0)
    (effect,) = found(with_force(made(2, drift=0.2), odd), made(1)).effects
    assert effect.covariate == "elapsed_time"
    assert effect.parameters[0].low < np.expm1(0.9 * 0.2) < effect.parameters[0].high


def with_force(table: PushTable, factor: Array) -> PushTable:
    forces = {name: table.covariates[name] * factor for name in ("normal_force", "tangential_force")}
    return replace(table, covariates={**table.covariates, **forces})


def test_changed_level_is_found_only_against_training() -> None:
    table = made(2, level=0.15)
    effects = found(table, made(1)).effects
    assert [(e.mechanism, e.covariate, e.basis) for e in effects] == [("surface_friction", "model_inputs", "constant")]
    assert effects[0].parameters[0].low < np.expm1(0.15) < effects[0].parameters[0].high
    assert found(table, None).effects == ()


def test_dependence_on_place_that_training_has_too_is_not_reported() -> None:
    before, now = (with_force(made(seed), np.exp(5.0 * made(seed).covariates["slider_x"])) for seed in (1, 2))
    assert found(now, made(1)).effects[0].covariate == "slider_x"
    assert found(now, before).effects == ()


def on_an_uneven_table(seed: int) -> PushTable:
    """Windows of a rig on whose table the friction varies from place to place, the same for every seed."""
    table, rng = made(seed), np.random.default_rng([seed, 4])
    place = 0.05 * rng.standard_normal((PUSHES, 2)).repeat(WINDOWS, axis=0)
    waves = np.random.default_rng(1).normal(0.0, 2.0 * np.pi / 0.1, (6, 2))
    grip = np.exp(0.2 * np.sin(place @ waves.T + np.arange(6)).mean(axis=1) * np.sqrt(12.0))
    where = {"slider_x": place[:, 0], "slider_y": place[:, 1]}
    return with_force(replace(table, covariates={**table.covariates, **where}), grip)


@pytest.mark.long
def test_level_holds_on_a_table_whose_friction_varies_with_position() -> None:
    """Training and new pushes are at other places of the same table; independent pairs, so that counts are binomial."""
    p_values = []
    for seed in range(40):
        finding = found(on_an_uneven_table(100 + seed), on_an_uneven_table(500 + seed))
        p_values.append(min(tried.p_value for tried in finding.tested))
    assert np.sum(np.array(p_values) <= 0.2) <= 13  # 97.5 % of a binomial of 40 and 0.2
    assert np.sum(np.array(p_values) <= 0.05) <= 5


@pytest.mark.slow
def test_finds_nothing_without_an_effect() -> None:
    for seed in range(10, 13):
        assert found(made(seed), made(1)).effects == ()
        assert found(made(seed), None).effects == ()


def test_changed_contact_friction_is_not_reported_as_surface_friction() -> None:
    assert found(made(2, contact_friction=0.4), made(1)).effects == ()


def test_windows_without_a_force_give_no_finding() -> None:
    table = made(2)
    assert found(replace(table, covariates={}), table) == found(replace(table, covariates={}), None)
    assert found(replace(table, covariates={}), table).tested == ()


@pytest.mark.slow
def test_drift_of_the_force_in_a_recording_is_found_and_leaves_the_motion_unchanged() -> None:
    pushes = random_pushes(40, (0.02, 0.05), travel=0.02, rng=np.random.default_rng(3))
    recording = simulate(SimulationSpec("rect1", "delrin", pushes, seed=3))
    rig, wrench = recording.rig, recording.wrench
    assert rig is not None and wrench is not None
    share = (wrench.stamp - wrench.stamp[0]) / np.ptp(wrench.stamp)
    worn = replace(wrench, fx=wrench.fx * (1.0 + 0.4 * share), fy=wrench.fy * (1.0 + 0.4 * share))
    clean, drifted = (windows_to_table(find_windows(r, rig)) for r in (recording, replace(recording, wrench=worn)))
    assert np.array_equal(clean.outcomes, drifted.outcomes)
    assert found(clean, None).effects == ()
    effect = found(drifted, clean).effects[0]
    assert effect.mechanism == "surface_friction"
    assert {effect.covariate, *effect.rivals} >= {"elapsed_time", "push_index", "slid_distance"}
    assert effect.parameters[0].low > 0.2


def test_simplest_form_within_a_standard_error_of_the_best_is_chosen() -> None:
    """A slight curvature gains a little by chance; a strong one surely."""
    stack, name = stacked(made(2), None), "topic:/hum"
    x = made(2).covariates[name]
    noise, ones = np.random.default_rng(4).standard_normal(len(x)), np.ones((len(x), 1))
    bases = [standard_basis(basis, name, x) for basis in ("linear", "quadratic")]
    tried = [along(stack, "surface_friction", name, basis, np.ones(1)) for basis in bases]
    for curvature, form in ((0.1, "linear"), (0.5, "quadratic")):
        z = (x + curvature * x**2 + noise)[:, None]
        assert best_and_rivals(z, tried, ones, stack.block)[0].basis.name == "quadratic"
        (chosen,), _, _ = searched(Quantity.of(z, ones, stack, tried, stack.new), 0.01)
        assert chosen.contrast.basis.name == form

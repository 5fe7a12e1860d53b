# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The joint fit of the mechanics' parameters and the ladder that chooses them, on simulated outcomes with noise."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from repository import REPOSITORY
from synthetic import square_rig

from push_predictor.errors import TrainingError
from push_predictor.models.mechanics.fit import FitRows, fit_jointly, held_out_residuals, refit
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.ladder import CrossValidation, Rung, candidates, climb, worthwhile
from push_predictor.models.mechanics.parameters import BY_NAME, PARAMETERS
from push_predictor.models.mechanics.surface import uniform_ellipsoid

NOISE = np.array([3e-5, 3e-5, 1e-3])
TRUE = {"contact_friction": 0.15, "centre_y": 0.006}


def ellipsoidal_mechanics() -> PushMechanics:
    rig = square_rig()
    return PushMechanics(rig.outline, rig.pusher_radius, uniform_ellipsoid(rig.outline))


def simulated(values: dict[str, float], n: int = 90, seed: int = 0, noise: float = 1.0) -> FitRows:
    """Windows of 0.2 s, three alike per push, each push with a disturbance of its own in addition to the windows'."""
    rng, push = np.random.default_rng(seed), np.arange(n) // 3
    inputs = np.column_stack([np.full(n // 3, 0.02), rng.random(n // 3), rng.uniform(-1.0, 1.0, n // 3)])[push]
    duration = np.full(n, 0.2)
    outcomes = ellipsoidal_mechanics().displacement(values, inputs, duration)
    disturbed = rng.standard_normal((n, 3)) + rng.standard_normal((n // 3, 3))[push]
    return FitRows(inputs, duration, outcomes + noise * NOISE * disturbed, push)


def test_fit_recovers_parameters_within_their_intervals() -> None:
    fit = fit_jointly(ellipsoidal_mechanics(), simulated(TRUE), tuple(TRUE))
    error = np.sqrt(np.diag(fit.covariance))
    found = np.array(list(fit.values.values()))
    assert np.all(np.abs(found - list(TRUE.values())) < 3.0 * error)
    assert np.all(error < [0.02, 5e-4]) and np.all(error > [1e-3, 2e-5])


@pytest.mark.long
def test_intervals_cover_the_true_value_as_often_as_they_state() -> None:
    deviation = []
    for seed in range(12):
        fit = fit_jointly(ellipsoidal_mechanics(), simulated(TRUE, n=60, seed=seed), ("centre_y",))
        deviation.append((fit.values["centre_y"] - TRUE["centre_y"]) / np.sqrt(fit.covariance[0, 0]))
    assert 0.7 < np.std(deviation) < 1.4


def test_interval_grows_with_the_noise_shared_by_a_push() -> None:
    rows = simulated(TRUE)
    shared = fit_jointly(ellipsoidal_mechanics(), rows, ("contact_friction",))
    alone = replace(shared, rows=replace(rows, push=np.arange(len(rows.push))))
    assert shared.covariance[0, 0] > 1.2 * alone.covariance[0, 0]


def test_ladder_finds_the_parameters_that_differ_from_the_textbook() -> None:
    ladder = climb(ellipsoidal_mechanics(), simulated(TRUE))
    assert set(ladder[-1].fit.names) == set(TRUE)
    assert [len(rung.fit.names) for rung in ladder] == [0, 1, 2]
    assert all(rung.gain > rung.error > 0.0 for rung in ladder[1:])


@pytest.mark.parametrize("seed", range(3))
def test_ladder_adds_nothing_to_textbook_outcomes_with_noise(seed: int) -> None:
    ladder = climb(ellipsoidal_mechanics(), simulated({}, seed=seed))
    assert [rung.fit.names for rung in ladder] == [()]


def test_ladder_adds_a_pair_that_shows_only_together() -> None:
    ladder = climb(ellipsoidal_mechanics(), simulated({"centre_x": 0.003, "outline_x": -0.003}))
    assert [rung.added for rung in ladder] == [(), ("centre_x", "outline_x")]


def test_ladder_drops_a_parameter_that_mimicked_others() -> None:
    true = {"contact_friction": 0.15, "friction_by_angle": 0.2}
    first, mimic, last = climb(ellipsoidal_mechanics(), simulated(true, seed=1))
    assert mimic.added == mimic.fit.names == last.dropped == ("friction_by_speed",)
    assert set(last.fit.names) == set(true) and not first.fit.names


def test_gain_must_exceed_its_standard_error_and_five_nats_a_parameter() -> None:
    mechanics, rows = ellipsoidal_mechanics(), simulated({})
    none, one = (fit_jointly(mechanics, rows, names) for names in ((), ("contact_friction",)))
    found = [
        worthwhile(none, Rung(one, ("contact_friction",), (), gain, error)) for gain, error in ((9, 8), (9, 10), (4, 1))
    ]
    assert found == [True, False, False]


def test_refit_without_a_parameter_is_the_fit_of_the_others() -> None:
    mechanics, rows = ellipsoidal_mechanics(), simulated(TRUE)
    both, alone = (fit_jointly(mechanics, rows, names) for names in (tuple(TRUE), ("centre_y",)))
    again = refit(mechanics, both, ("centre_y",))
    np.testing.assert_allclose(again.residuals / NOISE, alone.residuals / NOISE, atol=0.5)


def test_held_out_residuals_are_those_of_a_fit_to_the_other_pushes() -> None:
    mechanics, rows = ellipsoidal_mechanics(), simulated(TRUE, n=15)
    fit = fit_jointly(mechanics, rows, tuple(TRUE))
    known, exact = CrossValidation(fit), np.zeros((15, 3))
    for fold in range(5):
        others = known.fold != fold
        push = np.unique(rows.push[others], return_inverse=True)[1]
        kept = FitRows(rows.inputs[others], rows.duration[others], rows.outcomes[others], push)
        values = fit_jointly(mechanics, kept, fit.names, fit.values).values
        exact[~others] = (rows.outcomes - mechanics.displacement(values, rows.inputs, rows.duration))[~others]
    moved, expected = (known.residuals(fit.names) - fit.residuals) / NOISE, (exact - fit.residuals) / NOISE
    assert np.sum(moved * expected) / np.sum(expected**2) == pytest.approx(1.0, abs=0.15)


def test_dropping_a_parameter_of_the_fit_predicts_as_the_fit_without_it() -> None:
    rows = simulated({"contact_friction": 0.3, "centre_y": 0.001})
    wide = fit_jointly(ellipsoidal_mechanics(), rows, ("contact_friction", "centre_y"))
    alone = fit_jointly(ellipsoidal_mechanics(), rows, ("contact_friction",))
    dropped, never = (CrossValidation(fit).residuals(("contact_friction",)) for fit in (wide, alone))
    np.testing.assert_allclose(dropped / NOISE, never / NOISE, atol=0.5)
    kept = CrossValidation(wide).residuals(wide.names)
    assert np.abs(kept - never).max(axis=0)[2] > NOISE[2]


def test_residuals_of_a_held_out_push_are_those_of_a_fit_without_it() -> None:
    mechanics, names = ellipsoidal_mechanics(), ("contact_friction", "centre_x", "centre_y")
    rows = simulated({"contact_friction": 0.2}, n=30)
    fit = fit_jointly(mechanics, rows, names)
    held, first = held_out_residuals(mechanics, fit), rows.push == 0
    others = FitRows(
        rows.inputs[~first], rows.duration[~first], rows.outcomes[~first], rows.push[~first] - 1, rows.covariates
    )
    values = fit_jointly(mechanics, others, names).values
    refitted = rows.outcomes - mechanics.displacement(values, rows.inputs, rows.duration)
    np.testing.assert_allclose(held[first] / NOISE, refitted[first] / NOISE, atol=0.2)
    steep = fit.jacobian.copy()
    steep[0] *= 300.0  # a tip at a corner: these derivatives hold for tiny changes only
    misled = replace(fit, jacobian=steep)
    linear = np.einsum("nkp,np->nk", steep, misled.without_pushes[rows.push]) / NOISE
    assert np.abs(linear).max() > 100.0
    assert np.abs(held_out_residuals(mechanics, misled) / NOISE).max() < 50.0


def test_candidates_are_those_that_the_rows_can_show() -> None:
    rows, mechanics = simulated({}), ellipsoidal_mechanics()
    names = candidates(mechanics, rows)
    assert not {"grain_x", "inertia", "clock_delay", "rim_exponent"} & set(names)
    headed = replace(rows, covariates={"push_heading": np.zeros(len(rows.push))})
    assert "grain_x" in candidates(mechanics, headed)
    faster = replace(rows, inputs=rows.inputs * [1.0 + np.arange(len(rows.push))[0], 1.0, 1.0])
    faster.inputs[0, 0] *= 2.0
    assert {"inertia", "clock_delay"} <= set(candidates(mechanics, faster))
    on_patch = PushMechanics(mechanics.outline, mechanics.pusher_radius)
    assert "rim_exponent" in candidates(on_patch, rows)


def test_rejects_an_unknown_parameter_by_name() -> None:
    with pytest.raises(TrainingError, match="'stickiness' is no parameter"):
        fit_jointly(ellipsoidal_mechanics(), simulated({}), ("stickiness",))


def test_rejects_rows_that_are_not_finite() -> None:
    rows = simulated({})
    with pytest.raises(TrainingError, match="not finite"):
        replace(rows, outcomes=rows.outcomes * np.nan)


# --- the table of parameters ---


def test_every_parameter_has_its_own_name_and_a_textbook_value_in_range() -> None:
    assert len(BY_NAME) == len(PARAMETERS)
    for parameter in PARAMETERS:
        assert parameter.low <= parameter.textbook <= parameter.high
        assert 0.0 < parameter.spread <= parameter.high - parameter.low
        assert parameter.unit and parameter.meaning
        assert parameter.part in ("contact", "pressure", "measurement", "world")


def test_the_kernel_has_as_many_parameters() -> None:
    """It checks no bounds: with another number it would read and write past its rows."""
    source = (REPOSITORY / "push_predictor/models/mechanics/kernel/push.py").read_text()
    numbers = re.findall(r"PARAMETERS = cython.declare\(cython.int, (\d+)\)|own: cython.double\[(\d+)\]", source)
    assert [int(one or other) for one, other in numbers] == [len(PARAMETERS)] * 2

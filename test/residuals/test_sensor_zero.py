# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The force sensor's zero: a bias that the windows do not contain is found in free motion, with its size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from push_predictor.recordings.table import PushTable
from push_predictor.residuals.channels.contrast import NOTHING_FOUND, ChannelEffect
from push_predictor.residuals.channels.sensor_zero import BETWEEN_SESSIONS, zero_shift
from push_predictor.residuals.evidence.standardised import FEWEST_PUSHES
from push_predictor.types import Array

PUSHES, WINDOWS = 150, 3  # per push
NOISE = 0.02  # N, of the mean reading in free motion before a push
Vector = tuple[float, float]


def made(seed: int, bias: Vector = (0.0, 0.0), since: int = 0, drift: float = 0.0, pushes: int = PUSHES) -> PushTable:
    """Windows of a session: the sensor's zero, a bias from one push on, and noise that neighbouring pushes share."""
    rng = np.random.default_rng(seed)
    zero = np.tile(NOISE * rng.standard_normal(2), (pushes, 1)) + drift * shared(rng, pushes)
    zero += NOISE * rng.standard_normal((pushes, 2)) + np.where(np.arange(pushes)[:, None] >= since, bias, 0.0)
    return reading(zero)


def reading(zero: Array) -> PushTable:
    """Windows of pushes before which the sensor reads zero (p, 2)."""
    push = np.repeat(np.arange(len(zero)), WINDOWS)
    n = len(push)
    covariates = {"free_force_x": zero[push, 0], "free_force_y": zero[push, 1], "push_index": push.astype(np.float64)}
    inputs = np.column_stack([np.full(n, 0.02), np.linspace(0.0, 0.9, n), np.zeros(n)])
    return PushTable(inputs, np.full(n, 0.2), np.zeros((n, 3)), push.astype(np.str_), covariates)


def shared(rng: np.random.Generator, n: int) -> Array:
    """Noise (n, 2) of unit variance that neighbouring pushes share."""
    walk = rng.standard_normal((n, 2))
    walk[1:] *= 0.6
    return np.asarray(lfilter([1.0], [1.0, -0.8], walk, axis=0))


def without_zero(table: PushTable) -> PushTable:
    return replace(table, covariates={"push_index": table.covariates["push_index"]})


def found(windows: PushTable, baseline: PushTable | None) -> ChannelEffect:
    (shift,) = zero_shift(windows, baseline).effects
    return shift


@pytest.mark.parametrize("bias", [(0.2, 0.0), (-0.1, 0.15), (0.3, -0.4)])
def test_bias_since_training_is_found_with_its_size(bias: Vector) -> None:
    shift = found(made(1, bias), made(2))
    assert (shift.covariate, shift.basis) == ("model_inputs", "constant")
    assert shift.p_value < 0.001
    for size, truth in zip(shift.parameters, bias, strict=True):
        assert size.value == pytest.approx(truth, abs=5.0 * BETWEEN_SESSIONS)
        assert size.unit == "N"


def test_bias_from_a_push_on_is_found_as_a_step_with_its_size() -> None:
    for baseline in (made(2), None, without_zero(made(2))):
        shift = found(made(1, (0.3, -0.2), since=97), baseline)
        assert (shift.covariate, shift.basis) == ("push_index", "step")
        assert shift.p_value < 1e-4
        for size, truth in zip(shift.parameters, (0.3, -0.2), strict=True):
            assert size.low < truth < size.high and size.high - size.low < 0.03


def test_a_step_may_have_no_more_than_the_fewest_pushes_behind_it() -> None:
    bias = np.where(np.arange(25)[:, None] >= 25 - FEWEST_PUSHES, (0.0, 0.5), 0.0)
    shift = found(reading(bias), None)
    assert (shift.basis, shift.parameters[1].value) == ("step", pytest.approx(0.5))


def test_smallest_bias_that_is_found_is_as_documented() -> None:
    """In docs/reference/trace.md, at a level of 0.001."""
    sound = reading(np.zeros((PUSHES, 2)))
    for since, missed, seen in ((0, 0.107, 0.113), (PUSHES // 2, 0.088, 0.103)):
        for size in (missed, seen):
            bias = np.where(np.arange(PUSHES)[:, None] >= since, (0.0, size), 0.0)
            assert (found(reading(bias), sound).p_value <= 0.001) == (size == seen)


def test_interval_covers_the_change_even_if_neighbouring_pushes_share_noise() -> None:
    covered = []
    for seed in range(40):
        rng = np.random.default_rng([seed, 9])
        before, now = (made(seed, drift=0.0) for _ in range(2))
        for table, offset in ((before, 0.0), (now, 0.4)):
            for name, noise in zip(("free_force_x", "free_force_y"), shared(rng, PUSHES).T, strict=True):
                table.covariates[name][:] = offset + np.repeat(0.05 * noise, WINDOWS)
        covered += [size.low < 0.4 < size.high for size in found(now, before).parameters]
    assert 0.8 < np.mean(covered) < 0.99


def test_zeros_that_differ_as_between_sessions_are_chance_at_every_level() -> None:
    p_values = np.array([found(made(1000 + k, pushes=40), made(5000 + k, pushes=40)).p_value for k in range(150)])
    for level in (0.01, 0.05, 0.2):
        assert np.sum(p_values <= level) <= 150 * level + 2.0 * np.sqrt(150 * level)
    assert np.any(p_values <= 0.2)


def test_change_since_training_is_not_stated_if_training_lacks_the_zero() -> None:
    """Model files of earlier versions do not contain it; a rig's sensor may never have been zeroed."""
    for baseline in (None, without_zero(made(2)), made(2, pushes=5)):
        assert found(made(1, (0.5, 0.5)), baseline).p_value > 0.2


def test_tables_without_the_zero_or_with_few_pushes_give_none() -> None:
    assert zero_shift(without_zero(made(1)), made(2)) == NOTHING_FOUND
    assert zero_shift(made(1, pushes=5), made(2)) == NOTHING_FOUND
    table = made(1)
    table.covariates["free_force_y"][0] = np.nan
    assert zero_shift(table, made(2)) == NOTHING_FOUND


def test_a_change_is_an_effect_up_to_the_level_and_a_candidate_beyond() -> None:
    biased, sound = made(1, (0.2, 0.0)), made(2)
    for level, count in ((0.01, 1), (1e-30, 0)):
        finding = zero_shift(biased, sound, level)
        assert len(finding.effects) == count
        assert [(t.mechanism, t.covariate) for t in finding.tested] == [("wrench_bias", "session")]

# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The sweep for small tolerances, on made-up rates whose motion is known: smooth ones, kinks, and gaps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from push_predictor.models.mechanics.motion.fine_sweep import AFTER, DIFFERENCE, KindRateOf, KindRates, swept_finely
from push_predictor.models.mechanics.motion.sweep import LONGEST_STEP, swept
from push_predictor.models.mechanics.scalar import sweep as scalar

from push_predictor.types import Array, IntArray

ACCURACY, LENGTH, TRAVEL = 1e-4, 0.03, 0.02
Speed = Callable[[Array, Array], Array]  # along x, from x and the travel done, m


def rates(speed: Speed, kind: Speed) -> KindRateOf:
    def rate_of(rows: IntArray, pose: Array, done: Array) -> KindRates:
        rate = np.zeros((len(rows), 3))
        rate[:, 0] = speed(pose[:, 0], done)
        return rate, np.zeros(len(rows)), np.ones(len(rows)), np.asarray(kind(pose[:, 0], done), dtype=np.float64)

    return rate_of


def reached(speed: Speed, kind: Speed) -> tuple[float, float]:
    """x after the travel, from arrays and in plain numbers."""
    together = rates(speed, kind)

    def alone(x: float, y: float, heading: float, done: float) -> scalar.Rates:
        rate, gap, nearing, contact = together(
            np.zeros(1, dtype=np.int64), np.array([[x, y, heading]]), np.array([done])
        )
        return float(rate[0, 0]), 0.0, 0.0, float(gap[0]), float(nearing[0]), float(contact[0])

    pose = swept_finely(together, np.full(2, TRAVEL), np.full(2, LENGTH), ACCURACY)
    return float(pose[0, 0]), scalar.swept_finely(alone, TRAVEL, LENGTH, ACCURACY)[0]


def one_kind(x: Array, done: Array) -> Array:
    return np.zeros_like(done)


SMOOTH: dict[str, tuple[Speed, float]] = {  # with where each ends
    "depends on the travel": (lambda x, s: 1.0 + np.cos(1200.0 * s), TRAVEL + np.sin(1200.0 * TRAVEL) / 1200.0),
    "depends on the pose": (lambda x, s: 1.0 - 900.0 * x, (1.0 - np.exp(-900.0 * TRAVEL)) / 900.0),
}


@pytest.mark.parametrize("name", SMOOTH)
def test_fast_changes_of_the_rate_shorten_the_steps(name: str) -> None:
    speed, expected = SMOOTH[name]
    assert reached(speed, one_kind) == pytest.approx([expected] * 2, abs=ACCURACY * TRAVEL)


@pytest.mark.parametrize("begins", np.linspace(0.1, 0.9, 5) * LONGEST_STEP)
@pytest.mark.parametrize("lasts", [0.4 * LONGEST_STEP, 2.3 * LONGEST_STEP])
def test_a_time_of_rest_is_not_stepped_over(begins: float, lasts: float) -> None:
    """Next to jumps a step and its halves may agree by chance, so its length is found to a tenth."""

    def rests(x: Array, done: Array) -> Array:
        return np.asarray((done >= begins) & (done < begins + lasts))

    found = reached(lambda x, s: np.where(rests(x, s), 0.0, 1.0), rests)
    assert found[0] == pytest.approx(found[1], abs=1e-15)
    assert found[0] == pytest.approx(TRAVEL - lasts, abs=0.1 * lasts)


@pytest.mark.parametrize("stage", [1.0 / 3.0, 2.0 / 3.0, 1.0])
def test_a_step_is_smooth_only_if_all_its_stages_have_one_kind(stage: float) -> None:
    """The rate is the same at all stages of the first step, but not at those of its halves."""
    middle = 0.5 * LONGEST_STEP

    def speed(x: Array, done: Array) -> Array:
        return np.where(np.abs(done - middle) < 0.03 * LONGEST_STEP, 0.0, 1.0)

    def unseen(x: Array, done: Array) -> Array:
        return np.asarray(np.abs(done - middle) < 0.15 * LONGEST_STEP)

    def seen(x: Array, done: Array) -> Array:
        return unseen(x, done) | np.asarray(np.abs(done - stage * LONGEST_STEP) < 1e-9)

    assert reached(speed, unseen) == pytest.approx([TRAVEL] * 2, abs=1e-12)
    assert max(reached(speed, seen)) < TRAVEL - 0.04 * LONGEST_STEP


def test_the_difference_is_that_of_a_method_of_third_order() -> None:
    """Its weights add nothing to a parabola of the travel, and something to a cubic."""
    places, weights = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0, 1.0]), np.array([*DIFFERENCE, AFTER])
    of_power = [float(weights @ places**power) for power in range(4)]
    assert of_power[:3] == pytest.approx([0.0] * 3, abs=1e-15) and of_power[3] == pytest.approx(-1.0 / 108.0)
    stages = np.zeros((5, 5))  # of Kutta's 3/8 rule, and the step itself
    stages[1, 0], stages[2, :2], stages[3, :3], stages[4, :4] = (
        1 / 3,
        (-1 / 3, 1),
        (1, -1, 1),
        (1 / 8, 3 / 8, 3 / 8, 1 / 8),
    )
    assert weights @ stages @ places == pytest.approx(0.0, abs=1e-15)


@pytest.mark.filterwarnings("ignore:invalid value")
def test_rates_that_are_not_numbers_end_a_sweep_with_none() -> None:
    calls = 0

    def together(rows: IntArray, pose: Array, done: Array) -> KindRates:
        nonlocal calls
        calls += 1
        assert calls < 200
        nothing = np.full(len(rows), np.nan)
        return np.full((len(rows), 3), np.nan), np.zeros(len(rows)), nothing, nothing

    def coarsely(rows: IntArray, pose: Array, done: Array) -> tuple[Array, Array, Array]:
        return together(rows, pose, done)[:3]

    def alone(x: float, y: float, heading: float, done: float) -> scalar.Rates:
        together(np.zeros(1, dtype=np.int64), np.zeros((1, 3)), np.zeros(1))
        return np.nan, np.nan, np.nan, 0.0, np.nan, np.nan

    travel, length = np.full(2, TRAVEL), np.full(2, LENGTH)
    assert np.isnan(swept_finely(together, travel, length, ACCURACY)).all()
    assert np.isnan(swept(coarsely, travel, length, 1e-3)).all()
    assert np.isnan(scalar.swept(alone, TRAVEL, LENGTH, 1e-3)).all()
    assert np.isnan(scalar.swept_finely(alone, TRAVEL, LENGTH, ACCURACY)).all()

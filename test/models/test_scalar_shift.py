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

"""Exact effects of one push in plain numbers: the same shift and covariance as with arrays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from push_predictor.models.mechanics.analytical import AnalyticalPush
from synthetic import square_rig

from push_predictor.models.effects import scalar_shift
from push_predictor.models.effects.driver_basis import DriverBasis, columns_of
from push_predictor.models.effects.effect import Effect, mechanism_named
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.predictors import AnalyticalPredictor, ExtendedPredictor
from push_predictor.models.push import Push
from push_predictor.types import Array

PHYSICS = AnalyticalPush(square_rig().outline, square_rig().pusher_radius, 0.25)
FITTED = FittedMechanics(PushMechanics(square_rig().outline, square_rig().pusher_radius), {"centre_x": 0.003})
ALWAYS = DriverBasis("constant")
DRIFT = DriverBasis("linear", ("elapsed_time",), (500.0,), (300.0,))
AROUND = DriverBasis("periodic", ("slider_heading",))
MAP = DriverBasis("map", ("warmth", "elapsed_time"), (0.0, 500.0), (1.0, 300.0))
BY_SPEED = DriverBasis("linear", ("velocity",), (0.03,), (0.01,))


def effect(mechanism: str, basis: DriverBasis, size: float = 1.0, exact: bool = True) -> Effect:
    """Of alternating signs, known to 10 %, with correlated coefficients; size: in usual spreads of the parameters."""
    width = columns_of(basis)
    spreads = np.repeat([BY_NAME[name].spread for name in mechanism_named(mechanism).quantities], width)
    signs = np.where(np.arange(len(spreads)) % 2, -1.0, 1.0)
    covariance = 0.01 * np.outer(spreads, spreads) * (0.6 * np.eye(len(spreads)) + 0.4)
    return Effect(mechanism, "any", basis, size * signs * spreads, covariance, np.ones(3), exact=exact)


def pushes(n: int = 16) -> Push:
    rng = np.random.default_rng(3)
    inputs = np.column_stack([rng.uniform(0.02, 0.05, n), rng.random(n), rng.uniform(-0.9, 0.9, n)])
    covariates = {
        "slider_heading": rng.uniform(-3.0, 3.0, n),
        "elapsed_time": rng.uniform(0.0, 2000.0, n),
        "warmth": rng.normal(size=n),
    }
    return Push(inputs, np.full(n, 0.2), covariates)


def one(push: Push, row: int) -> Push:
    return push.take(slice(row, row + 1))


def extended(*effects: Effect, of_effects: FittedMechanics | None = None) -> ExtendedPredictor:
    return ExtendedPredictor(AnalyticalPredictor(PHYSICS, np.eye(3)), PHYSICS, effects, np.ones(3), {}, of_effects)


def in_plain_numbers(predictor: ExtendedPredictor, monkeypatch: pytest.MonkeyPatch) -> ExtendedPredictor:
    """A predictor that fails where it would use arrays."""

    def never(*arguments: object, **named: object) -> Array:
        raise AssertionError("computed as arrays")

    monkeypatch.setattr(FittedMechanics, "displacement", never)
    scalar = predictor.with_scalar_mechanics()
    assert isinstance(scalar, ExtendedPredictor)
    return scalar


CASES = {
    "constant": (effect("contact_friction", ALWAYS),),
    "linear": (effect("contact_friction", DRIFT, 0.5),),
    "map": (effect("contact_friction", MAP, 0.2),),
    "periodic, two parameters": (effect("centre_of_friction", AROUND),),
    "in the world": (effect("anisotropic_friction", ALWAYS, 0.5),),
    "of an input": (effect("contact_friction", BY_SPEED, 0.3),),
    "two on one parameter": (effect("contact_friction", ALWAYS), effect("contact_friction", DRIFT, 0.3)),
    "two": (effect("centre_of_friction", ALWAYS), effect("contact_friction", DRIFT, 0.3)),
    "beyond what a rig can have": (effect("centre_of_friction", DRIFT, 4.0),),
}


@pytest.mark.parametrize("of_effects", [None, FITTED], ids=["analytical", "fitted"])
@pytest.mark.parametrize("case", CASES)
def test_one_push_has_the_shift_that_it_has_among_others(
    case: str, of_effects: FittedMechanics | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    predictor, push = extended(*CASES[case], of_effects=of_effects), pushes()
    together = predictor.shift(push)
    assert np.abs(together.mean[:, 1]).max() > 5e-5
    alone = in_plain_numbers(predictor, monkeypatch)
    for k in range(len(push.inputs)):
        mean, covariance = alone.shift(one(push, k))
        assert mean.shape == (1, 3) and covariance.shape == (1, 3, 3)
        np.testing.assert_allclose(mean[0], together.mean[k], rtol=1e-4, atol=1e-8)
        np.testing.assert_allclose(covariance[0], together.covariance[k], rtol=2e-4, atol=1e-13)


def test_the_covariance_that_effects_share_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = CASES["two"]
    shared = -0.5 * np.sqrt(np.outer(np.diag(first.covariance), np.diag(second.covariance)))
    predictor = replace(extended(first, second), cross={(0, 1): shared})
    slips = int(np.argmax(extended(second).shift(pushes()).covariance[:, 1, 1]))
    push = one(pushes(), slips)
    together, apart = predictor.shift(push).covariance, extended(first, second).shift(push).covariance
    assert np.abs(together - apart).max() > 0.05 * np.abs(apart).max()
    alone = in_plain_numbers(predictor, monkeypatch).shift(push).covariance
    np.testing.assert_allclose(alone, together, rtol=2e-4, atol=1e-13)


def test_the_heading_of_the_slider_takes_precedence(monkeypatch: pytest.MonkeyPatch) -> None:
    predictor = extended(*CASES["in the world"])
    push = one(pushes(), 0)
    both = Push(push.inputs, push.duration, {**push.covariates, "push_heading": np.array([1.0])})
    alone = {"push_heading": np.array([1.0])}
    cases = both, Push(push.inputs, push.duration, alone)
    expected = [predictor.shift(given).mean for given in cases]
    scalar = in_plain_numbers(predictor, monkeypatch)
    for given, mean in zip(cases, expected, strict=True):
        np.testing.assert_allclose(scalar.shift(given).mean, mean, rtol=1e-4, atol=1e-8)


OTHERS = (
    "linear in its coefficients",
    "inertia",
    "inertia of an effect",
    "a speed that is not finite",
    "a heading that is not finite",
    "changes that overflow",
    "two pushes",
)


@pytest.mark.filterwarnings("ignore:(overflow|invalid value)")
@pytest.mark.parametrize("what", OTHERS)
def test_other_pushes_are_computed_as_arrays(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    name = "inertia" if what == "inertia of an effect" else "contact_friction"
    acting = effect(name, ALWAYS, exact=what != "linear in its coefficients")
    of_effects = replace(FITTED, values={"inertia": 0.1}) if what == "inertia" else None
    predictor, push = extended(acting, of_effects=of_effects), pushes(2)
    if what != "two pushes":
        push = one(push, 0)
    if what == "a speed that is not finite":
        push.inputs[0, 0] = np.nan
    if what == "a heading that is not finite":
        predictor = extended(*CASES["periodic, two parameters"])
        push.covariates["slider_heading"][0] = np.inf
    if what == "changes that overflow":  # infinite terms of different signs
        predictor = extended(effect("centre_of_friction", MAP))
        push.covariates["warmth"][0] = push.covariates["elapsed_time"][0] = 1e200
    found: list[object] = []
    shift = scalar_shift.ScalarShift.shift

    def recorded(self: scalar_shift.ScalarShift, push: Push) -> tuple[Array, Array] | None:
        alone = shift(self, push)
        found.append(alone)
        return alone

    monkeypatch.setattr(scalar_shift.ScalarShift, "shift", recorded)
    alone, expected = predictor.with_scalar_mechanics().shift(push), predictor.shift(push)
    assert found == ([] if what in ("linear in its coefficients", "two pushes") else [None])
    np.testing.assert_allclose(alone.mean, expected.mean, rtol=1e-4, atol=1e-8)
    if what == "changes that overflow":
        assert not np.isfinite(alone.mean).any()


def test_a_covariate_that_is_missing_is_named() -> None:
    push = one(pushes(), 0)
    for case, needed in (("linear", "elapsed_time"), ("in the world", "push_heading")):
        with pytest.raises(KeyError, match=needed):
            extended(*CASES[case]).with_scalar_mechanics().shift(Push(push.inputs, push.duration, {}))

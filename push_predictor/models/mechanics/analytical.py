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

"""The analytical push model of Lynch, Maekawa and Tanie 1992: the forward model on an ellipsoid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np

from push_predictor.errors import RequestError, RigError, TrainingError
from push_predictor.geometry.outline import Outline
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.limit_surface import Support, uniform_support
from push_predictor.models.mechanics.limit_surfaces.surfaces import PowerSurface
from push_predictor.types import Array

TEXTBOOK_FRICTION = 0.3
FRICTION_BOUNDS = (0.0, 2.0)  # of the fit; above 2 the motion cone of a usual slider covers all pushes
LENGTH_BOUNDS = (0.02, 1.0)  # of the fit, as fractions of the farthest distance the support can reach
ACCURACY = 1e-4  # of a displacement, relative
WEIGHTING_ROUNDS = 3
DIFFERENCE_STEP = 1e-3  # relative, above the error of the integration
PARAMETER_TOLERANCE = 1e-5  # relative
INTEGRATION_NOISE = 1e-4  # relative; smaller residuals are rounding


@dataclass(frozen=True, eq=False)
class AnalyticalPush:
    """Quasi-static pushing of a slider on an ellipsoidal limit surface by a disc with Coulomb friction.

    pusher_radius in m, contact_friction a finite number >= 0, support by default that of uniform pressure.
    Raises RigError for another radius or friction.
    """

    outline: Outline
    pusher_radius: float
    contact_friction: float = TEXTBOOK_FRICTION
    support: Support = field(default=cast(Support, None))  # None only until __post_init__ has run

    def __post_init__(self) -> None:
        for name in ("pusher_radius", "contact_friction"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise RigError(f"{name}: {value!r} is not accepted, give a finite number >= 0")
        if cast("Support | None", self.support) is None:
            object.__setattr__(self, "support", uniform_support(self.outline))

    def displacement(self, inputs: Array, duration: Array) -> Array:
        """Displacement (n, 3: dx, dy in m, dtheta in rad) of the body's origin in the push direction's frame.

        inputs (n, 3): velocity in m/s, contact as a fraction of the perimeter, angle in rad
        (docs/reference/push.md); duration (n,) in s. The pusher's centre runs straight at constant velocity. Where the
        pusher slides off, the slider stays. Raises RequestError for a value that is not finite or goes back.
        """
        _check_request(inputs, duration)
        return self.mechanics.displacement({"contact_friction": self.contact_friction}, inputs, duration)

    def displacements(self, others: Sequence[AnalyticalPush], inputs: Array, duration: Array) -> Array:
        """Displacements (k, n, 3) by k models with other frictions and supports, computed as one set of pushes.

        Raises RequestError as `displacement` does.
        """
        _check_request(inputs, duration)
        k, n = len(others), len(inputs)
        every = np.tile(inputs, (k, 1)), np.tile(duration, k)
        centre = np.array([other.support.centre for other in others]) - self.support.centre
        spread = np.log([other.support.length / self.support.length for other in others])
        given = {"centre_x": centre[:, 0], "centre_y": centre[:, 1], "pressure_spread": spread}
        given["contact_friction"] = np.array([other.contact_friction for other in others])
        values = {name: np.repeat(value, n) for name, value in given.items()}
        return self.mechanics.displacement(values, *every).reshape(k, n, 3)

    @property
    def mechanics(self) -> PushMechanics:
        """The forward model on the support's ellipsoid."""
        ellipsoid = PowerSurface(np.array(self.support.centre), self.support.length)
        return PushMechanics(self.outline, self.pusher_radius, ellipsoid, accuracy=ACCURACY)


def fit_analytical(model: AnalyticalPush, inputs: Array, duration: Array, outcomes: Array) -> AnalyticalPush:
    """The model with the contact friction and length c that fit outcomes (n, 3: dx, dy, dtheta) best.

    Least squares over the three outputs, each in units of the scale of its residuals, which is estimated again
    from the fit WEIGHTING_ROUNDS times: the Gaussian likelihood's maximum for unknown, constant scales. The
    centre of friction and the outline are kept. Bounds: friction 0 to 2; c from 0.02 to 1 of the distance of the
    outline's farthest point from the centre of friction, which no pressure can exceed. Deterministic. Raises
    TrainingError for rows of different numbers, fewer than two of them, or values that are not finite.
    """
    from scipy.optimize import least_squares  # its import would take every node 0.2 s at the start

    _check_rows(inputs, duration, outcomes)
    low, high = _bounds(model)
    inset = 1e-3 * (high - low)  # least_squares must start inside the bounds
    estimate = np.clip([model.contact_friction, model.support.length], low + inset, high - inset)

    def residuals(parameters: Array) -> Array:
        return _with(model, parameters).displacement(inputs, duration) - outcomes

    noise = INTEGRATION_NOISE * _root_mean_square(outcomes) + np.finfo(np.float64).tiny
    for _ in range(WEIGHTING_ROUNDS):
        scale = np.maximum(_root_mean_square(residuals(estimate)), noise)
        estimate = least_squares(
            lambda p, unit=scale: (residuals(p) / unit).ravel(),
            estimate,
            bounds=(low, high),
            x_scale=high - low,
            diff_step=DIFFERENCE_STEP,
            xtol=PARAMETER_TOLERANCE,
        ).x
    return _with(model, estimate)


def _check_request(inputs: Array, duration: Array) -> None:
    (velocity, contact, angle), duration = np.asarray(inputs, np.float64).T, np.asarray(duration, np.float64)
    for name, values in (("contact", contact), ("angle", angle), ("velocity", velocity), ("duration", duration)):
        wrong = ~np.isfinite(values) | (name in ("velocity", "duration")) & (values < 0.0)
        if np.any(wrong):
            raise RequestError(name, float(values[wrong][0]), "a finite number, velocity and duration >= 0")


def _root_mean_square(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def _with(model: AnalyticalPush, parameters: Array) -> AnalyticalPush:
    friction, length = (float(p) for p in parameters)
    return replace(model, contact_friction=friction, support=replace(model.support, length=length))


def _bounds(model: AnalyticalPush) -> tuple[Array, Array]:
    reach = float(np.max(np.linalg.norm(model.outline.vertices - model.support.centre, axis=1)))
    shares = np.array([FRICTION_BOUNDS, (LENGTH_BOUNDS[0] * reach, LENGTH_BOUNDS[1] * reach)])
    return shares[:, 0], shares[:, 1]


def _check_rows(inputs: Array, duration: Array, outcomes: Array) -> None:
    n = len(duration)
    if n < 2 or np.shape(inputs) != (n, 3) or np.shape(outcomes) != (n, 3):
        raise TrainingError(
            f"rows: inputs {np.shape(inputs)}, duration {np.shape(duration)}, outcomes {np.shape(outcomes)} "
            "are not accepted, give (n, 3), (n,), (n, 3) with n of at least 2"
        )
    if not all(np.all(np.isfinite(values)) for values in (inputs, duration, outcomes)):
        raise TrainingError("rows: a value is not finite, give finite inputs, durations and outcomes")

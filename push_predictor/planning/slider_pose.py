"""Where a slider will be: from poses in the world to the push that a model knows, and its outcome back to the world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite, remainder, tau

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.geometry.frames import wrap_angle
from push_predictor.geometry.touch import Touch, covariance_in_world, displaced, touches
from push_predictor.models.effects.covariate_range import HEADINGS
from push_predictor.models.push_model import PushModel
from push_predictor.models.request import PushRequest, check_request
from push_predictor.models.tabulated.tabulated_model import TabulatedModel
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.types import Array

# m, as in the windows a model learns from: no force tells here, so the gap must be as small as where none was recorded;
# a tip that reaches in does touch, and may do so by what tracker and outline may be off.
MAX_GAP = WindowOptions().touch_gap_alone
MAX_DEPTH = WindowOptions().touch_gap
AGREEMENT = 1e-3  # m or rad by which a covariate may differ from what the poses say


@dataclass(frozen=True, eq=False)
class WorldPush:
    """A tip that drives at a slider, in the world.

    slider (3,): x, y m, heading rad; pusher (2,): the tip's centre, m; velocity (2,) m/s; duration s. covariates: by
    name, what an extended model needs and poses do not tell.
    """

    slider: Array
    pusher: Array
    velocity: Array
    duration: float
    covariates: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class SliderAfter:
    """A slider after a push, in the world: pose (3,) m, m, rad (unwrapped), its covariance (3, 3), and whether the push
    was in the model's domain.
    """

    pose: Array
    covariance: Array
    in_domain: bool


def slider_after(predictor: PushModel | TabulatedModel, push: WorldPush) -> SliderAfter:
    """The outcome of one push.

    Raises RequestError where a value is not finite, the tip rests, does not touch, touches from inside, moves away from
    or along the outline, where a covariate contradicts the poses, and where `check_request` does.
    """
    model = predictor.model if isinstance(predictor, TabulatedModel) else predictor
    touch = touch_of(model.rig, push)
    covariates = completed_covariates(push, touch, model.rig)
    velocity, contact, angle = touch.inputs[0].tolist()
    request = PushRequest(velocity, contact, angle, push.duration, covariates)
    check_request(model, request)
    prediction = predictor.predict_rows(*request.arrays)
    return SliderAfter(
        displaced(push.slider[None], touch.heading, prediction.mean)[0],
        covariance_in_world(prediction.covariance, touch.heading)[0],
        bool(prediction.in_domain[0]),
    )


def touch_of(rig: Rig, push: WorldPush) -> Touch:
    """The one touch (n = 1) of a push. Raises RequestError, see `slider_after`."""
    _check_finite(push)
    touch = touches(rig.outline, push.slider[None], push.pusher[None], push.velocity[None])
    _check_contact(push, float(touch.distance[0]), rig.pusher_radius)
    _check_direction(push, float(touch.inputs[0, 2]))
    return touch


def completed_covariates(push: WorldPush, touch: Touch, rig: Rig) -> dict[str, float]:
    """The push's covariates and those that the poses tell, which need not be brought.

    Raises RequestError where one was brought and contradicts the poses.
    """
    told = {
        "slider_x": float(push.slider[0]),
        "slider_y": float(push.slider[1]),
        "slider_heading": float(wrap_angle(push.slider[2])),
        "push_heading": float(touch.heading[0]),
        "contact_gap": float(touch.distance[0]) - rig.pusher_radius,
    }
    for name, value in told.items():
        brought = push.covariates.get(name, value)
        apart = brought - value
        if name in HEADINGS and isfinite(apart):
            apart = remainder(apart, tau)
        if not abs(apart) <= AGREEMENT:
            raise RequestError(f"covariate {name}", brought, f"{value:.6g}, as the poses say, or leave it out")
    return {**push.covariates, **told}


def _check_finite(push: WorldPush) -> None:
    values = {"slider": push.slider, "pusher": push.pusher, "pusher_velocity": push.velocity}
    for name, value in values.items():
        if not np.all(np.isfinite(value)):
            raise RequestError(name, _shown(value), "finite numbers")
    if not np.any(push.velocity):
        raise RequestError("pusher_velocity", _shown(push.velocity), "a velocity above 0 in the plane, in m/s")


def _check_contact(push: WorldPush, distance: float, radius: float) -> None:
    gap = distance - radius
    if distance < 0.0:
        wrong = f"outside the slider: its centre is {-distance:.3g} m inside the outline"
    elif gap < -MAX_DEPTH:
        wrong = f"that touches from outside: it reaches {-gap:.3g} m into the outline, up to {MAX_DEPTH:g} m is contact"
    elif not gap <= MAX_GAP:  # nor is one that overflowed
        wrong = f"that touches: the gap to the outline is {gap:.3g} m, up to {MAX_GAP:g} m is contact"
    else:
        return
    raise RequestError("pusher", _shown(push.pusher), f"a tip {wrong}")


def _check_direction(push: WorldPush, angle: float) -> None:
    if abs(angle) >= np.pi / 2.0:
        accepted = f"one less than 90 degrees off the inward normal; it is {np.degrees(angle):.1f} degrees off"
        raise RequestError("pusher_velocity", _shown(push.velocity), accepted)


def _shown(values: Array) -> tuple[float, ...]:
    return tuple(float(f"{value:.6g}") for value in values)

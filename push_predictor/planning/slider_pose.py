# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Predict the slider's pose in the world after a push, from the poses of slider and pusher."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite, remainder, tau

import numpy as np

from push_predictor.errors import ContactError, CovariateError, RequestError
from push_predictor.geometry.frames import wrap_angle
from push_predictor.geometry.touch import Touch, covariance_in_world, displaced, touches
from push_predictor.models.effects.covariates import HEADINGS
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.request import PushRequest, check_request, domain_remark
from push_predictor.models.tabulated.tabulated_model import TabulatedModel
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.types import Array

# m, as for training windows. Without a force the gap must be as small as in recordings without one. A tip inside the
# outline is in contact; the depth may be as large as the error of tracker and outline.
MAX_GAP = WindowOptions().touch_gap_alone
MAX_DEPTH = WindowOptions().touch_gap
AGREEMENT = 1e-3  # m or rad by which a given covariate may differ from the poses


@dataclass(frozen=True, eq=False)
class WorldPush:
    """A push in world coordinates.

    slider (3,): x, y m, heading rad; pusher (2,): centre of the tip, m; velocity (2,) m/s; duration s. covariates: by
    name, those that an extended model needs and the poses do not give.
    """

    slider: Array
    pusher: Array
    velocity: Array
    duration: float
    covariates: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class SliderAfter:
    """The predicted slider after a push, in the world.

    pose (3,): m, m, rad (unwrapped), with covariance (3, 3); in_domain: whether the push is in the model's domain;
    remark: in words, why it is not, else empty.
    """

    pose: Array
    covariance: Array
    in_domain: bool
    remark: str = ""


def slider_after(predictor: PushModel | TabulatedModel, push: WorldPush) -> SliderAfter:
    """Predict the slider's pose after one push.

    Raises RequestError if a value is not finite; if the tip does not move, does not touch, is inside the slider, or
    moves away from or along the outline; if a covariate contradicts the poses; and as `check_request` does.
    """
    model = predictor.model if isinstance(predictor, TabulatedModel) else predictor
    touch = touch_of(model.rig, push)
    covariates = completed_covariates(push, touch, model.rig)
    velocity, contact, angle = touch.inputs[0].tolist()
    request = PushRequest(velocity, contact, angle, push.duration, covariates)
    check_request(model, request)
    prediction = predictor.predict_rows(*request.arrays)
    remark = domain_remark(model, Push(*request.arrays), prediction.in_domain)
    return SliderAfter(
        displaced(push.slider[None], touch.heading, prediction.mean)[0],
        covariance_in_world(prediction.covariance, touch.heading)[0],
        bool(prediction.in_domain[0]),
        remark,
    )


def touch_of(rig: Rig, push: WorldPush) -> Touch:
    """The contact (n = 1) of a push. Raises RequestError, see `slider_after`."""
    _check_finite(push)
    touch = touches(rig.outline, push.slider[None], push.pusher[None], push.velocity[None])
    _check_contact(push, float(touch.distance[0]), rig.pusher_radius)
    _check_direction(push, float(touch.inputs[0, 2]))
    return touch


def completed_covariates(push: WorldPush, touch: Touch, rig: Rig) -> dict[str, float]:
    """The push's covariates and those known from the poses, which the caller may omit.

    Raises RequestError if a given covariate contradicts the poses.
    """
    known = {
        "slider_x": float(push.slider[0]),
        "slider_y": float(push.slider[1]),
        "slider_heading": float(wrap_angle(push.slider[2])),
        "push_heading": float(touch.heading[0]),
        "contact_gap": float(touch.distance[0]) - rig.pusher_radius,
    }
    for name, value in known.items():
        given = push.covariates.get(name, value)
        apart = given - value
        if name in HEADINGS and isfinite(apart):
            apart = remainder(apart, tau)
        if not abs(apart) <= AGREEMENT:
            raise CovariateError(f"covariate {name}", given, f"{value:.6g}, which follows from the poses, or omit it")
    return {**push.covariates, **known}


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
        wrong = f"tip outside the slider: its centre is {-distance:.3g} m inside the outline"
    elif gap < -MAX_DEPTH:
        wrong = (
            f"tip that touches from outside: it is {-gap:.3g} m inside the outline, at most {MAX_DEPTH:g} m is contact"
        )
    elif not gap <= MAX_GAP:  # rejects an overflow too
        wrong = f"tip in contact: the gap to the outline is {gap:.3g} m, at most {MAX_GAP:g} m is contact"
    else:
        return
    raise ContactError("pusher", _shown(push.pusher), f"a {wrong}")


def _check_direction(push: WorldPush, angle: float) -> None:
    if abs(angle) >= np.pi / 2.0:
        accepted = f"a direction within 90 degrees of the inward normal: it is {np.degrees(angle):.1f} degrees from it"
        raise ContactError("pusher_velocity", _shown(push.velocity), accepted)


def _shown(values: Array) -> tuple[float, ...]:
    return tuple(float(f"{value:.6g}") for value in values)

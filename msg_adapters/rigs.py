# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A rig <-> push_predictor_interfaces/PushRig, a loaded model -> ModelInfo."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from msg_adapters.predictions import doubles
from push_predictor.errors import RigError
from push_predictor.models.effects.covariates import UNITS, CovariateRange
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.rig import POSE, Rig, rig_from_record
from push_predictor_interfaces.msg import ModelInfo, PushRig

OPTIONAL = ("object_mass", "contact_friction", "surface_friction")  # 0 in a message: unknown
_UNLIMITED = CovariateRange(-inf, inf)  # of a covariate that the fitted effects do not depend on


def rig_to_message(rig: Rig) -> PushRig:
    """The message of a rig."""
    message = PushRig(shape=rig.shape, pusher_radius=float(rig.pusher_radius), surface=rig.surface)
    message.outline = doubles(rig.outline.vertices)
    message.semi_axes = [float(axis) for axis in rig.outline.semi_axes or (0.0, 0.0)]
    message.axes_pose = [float(value) for value in rig.outline.pose]
    for name in OPTIONAL:
        setattr(message, name, float(getattr(rig, name) or 0.0))
    message.support_points = doubles(np.empty(0) if rig.support_points is None else rig.support_points)
    return message


def rig_from_message(message: Any, source: str) -> Rig:
    """The rig of a message. Raises RigError that names the source and the field."""
    record: dict[str, object] = {"shape": message.shape, "surface": message.surface}
    record |= {"pusher_radius": message.pusher_radius, "outline": _rows(message.outline, 2)}
    record |= {name: value for name in OPTIONAL if (value := getattr(message, name)) != 0.0}
    if len(message.support_points):
        record["support_points"] = _rows(message.support_points, 3)
    a, b = map(float, message.semi_axes)
    if (a, b) != (0.0, 0.0):
        if not 0.0 < min(a, b) <= max(a, b) < np.inf:
            raise RigError(f"{source}: push_rig semi_axes {[a, b]}, give two lengths above 0 in m, or zeros")
        pose = dict(zip(POSE, map(float, message.axes_pose), strict=True))
        size = {"type": "circle", "radius": a} if a == b else {"type": "ellipse", "a": a, "b": b}
        record["shape_parameters"] = size | pose
    return rig_from_record(record, source)


def _rows(values: Any, width: int) -> list[list[float]]:
    """Rows of `width` numbers; a last one may be shorter, which makes the rig invalid."""
    flat = [float(value) for value in values]
    return [flat[k : k + width] for k in range(0, len(flat), width)]


def model_to_info(name: str, file: Path, model: PushModel, is_default: bool) -> ModelInfo:
    """The message of a model that requests call `name`."""
    info = ModelInfo(name=name, file=str(file), kind=model.kind, is_default=is_default)
    info.n_train, info.n_pushes = len(model.training), len(model.training.pushes)
    info.shape, info.surface, info.pusher_radius = model.rig.shape, model.rig.surface, float(model.rig.pusher_radius)
    info.window_duration = model.usual_duration
    info.duration_accepted = [float(limit) for limit in model.duration_range]
    info.velocity_domain, info.angle_domain = list(model.input_limits.velocity), list(model.input_limits.angle)
    ranges = [model.covariate_ranges.get(covariate, _UNLIMITED) for covariate in model.needs]
    info.covariates = list(model.needs)
    info.covariate_units = [UNITS.get(covariate, "") for covariate in model.needs]
    info.covariate_low, info.covariate_high = [known.low for known in ranges], [known.high for known in ranges]
    return info

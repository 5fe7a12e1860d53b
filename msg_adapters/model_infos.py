# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A loaded model -> push_predictor_interfaces/ModelInfo."""

from __future__ import annotations

from math import inf
from pathlib import Path

from push_predictor.models.effects.covariates import UNITS, CovariateRange
from push_predictor.models.push_model import PushModel
from push_predictor_interfaces.msg import ModelInfo

_UNLIMITED = CovariateRange(-inf, inf)  # of a covariate that the fitted effects do not depend on


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

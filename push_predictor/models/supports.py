# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A model of recordings with different support points, used for other recordings with support points of their own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.pressure import supported_at
from push_predictor.models.predictors import BasePredictor, GaussianProcessPredictor, MechanicsPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.rig import Rig
from push_predictor.types import Array


def on_supports(model: PushModel, rig: Rig | None, supports: Mapping[int, Array]) -> PushModel:
    """The model for recordings on these supports; itself unless it knows the supports of several recordings.

    supports: support points (k, 3) as in Rig, by number of the recording; empty if all stand on those of the rig.
    """
    base, known = model.predictor.base, _mechanics(model.predictor.base)
    if known is None or not known.supports or (rig is None and not supports):
        return model
    alone = None if supports or rig is None or rig.support_points is None else supported_at(rig.support_points)
    found = {number: supported_at(points) for number, points in supports.items()}
    mechanics = PushMechanics(known.outline, known.pusher_radius, alone, found)
    return replace(model, predictor=model.predictor.with_base(_with_mechanics(base, mechanics)))


def _mechanics(base: BasePredictor) -> PushMechanics | None:
    if isinstance(base, MechanicsPredictor):
        return base.fitted.mechanics
    if isinstance(base, GaussianProcessPredictor) and base.mean is not None:
        return base.mean.mechanics
    return None


def _with_mechanics(base: BasePredictor, mechanics: PushMechanics) -> BasePredictor:
    if isinstance(base, MechanicsPredictor):
        return replace(base, fitted=replace(base.fitted, mechanics=mechanics))
    assert isinstance(base, GaussianProcessPredictor)
    assert base.mean is not None
    return replace(base, mean=replace(base.mean, mechanics=mechanics))

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The pushes that a planner may choose from, for a model: all around the slider, at the model's training speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.geometry.outline import Outline
from push_predictor.models.prediction import Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.tabulated_model import TabulatedModel, tabulate
from push_predictor.planning.persistence import persistence_of
from push_predictor.planning.repertoire import Repertoire, push_grid, repertoire
from push_predictor.planning.unscented import PusherGeometry
from push_predictor.types import Array

WINDOWS = (1, 2, 3, 4, 5, 6, 8)  # lengths of pushes, in windows
PER_EDGE, PER_SMOOTH_OUTLINE = 9, 36  # contacts
MARGIN = 0.06  # share of an edge next to its corners that is not pushed
ANGLES = np.linspace(-1.2, 1.2, 13)  # rad


def model_repertoire(
    model: PushModel | TabulatedModel, velocity: float | None = None, windows: Sequence[int] = WINDOWS
) -> Repertoire:
    """Work out what straight pushes do that stay in the model's domain.

    velocity: of the pusher, m/s; the median of the training pushes unless given. windows: how many windows a push may
    last. Raises RequestError if no push stays in the domain or the model needs covariates.
    """
    tabulated = model if isinstance(model, TabulatedModel) else tabulate(model)
    trained = tabulated.model
    if trained.needs:
        raise RequestError("model", trained.name, f"one that needs no covariates, it needs {', '.join(trained.needs)}")
    speed = trained.usual_speed if velocity is None else velocity
    duration = trained.usual_duration

    def predict(inputs: Array) -> Prediction:
        return tabulated.predict_rows(inputs, np.full(len(inputs), duration))

    geometry = PusherGeometry(trained.rig.outline, trained.rig.pusher_radius, duration)
    lines = candidate_pushes(trained.rig.outline, speed)
    return repertoire(predict, geometry, lines, windows, persistent_fraction(trained, speed * duration))


def candidate_pushes(outline: Outline, velocity: float) -> Array:
    """Inputs (n, 3) of the pushes to choose from: at this velocity (m/s), all around the slider, in all directions."""
    return push_grid([velocity], contacts_around(outline), ANGLES)


def persistent_fraction(model: PushModel, path_length: float) -> float:
    """Fraction of a window's covariance that the next window of a push shares, after this path length (m)."""
    return float(persistence_of(model).correlation(np.array([path_length])).mean())


def contacts_around(outline: Outline) -> Array:
    """Contacts spread over the whole outline, away from corners."""
    if outline.semi_axes is not None:
        return np.arange(PER_SMOOTH_OUTLINE) / PER_SMOOTH_OUTLINE
    edges = np.arange(len(outline.vertices))[:, None]
    return outline.contact_on_edge(edges, np.linspace(MARGIN, 1.0 - MARGIN, PER_EDGE)).ravel()

"""The recording of residuals that a validator leaves: a bag of push_residual, with the scalars of the windows."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rclpy.serialization import serialize_message

from msg_adapters.residual_schema import RESIDUAL_DEFINITION, RESIDUAL_TYPE
from msg_adapters.residuals import ValidatedWindow, residual_to_message
from push_predictor.evaluation.live_validation import LiveValidation
from push_predictor.recordings.bag_writer import BagWriter
from push_predictor.recordings.cdr import encode
from push_predictor.recordings.definitions import FLOAT64, SCALAR_LAYOUTS
from push_predictor.recordings.windows import PushWindow
from push_predictor.types import Array
from push_predictor_interfaces.msg import PushResidual

TOPIC = "push_residual"
BAG = "residuals"
SCALAR = "topic:"  # begins the name of a scalar topic's covariate


def write_residuals(validation: LiveValidation, folder: Path) -> Path:
    """Write FOLDER/residuals, a rosbag2 folder with a message for every answer, and one for every scalar of a window at
    its start. Raises RecordingError.
    """
    path = folder / BAG
    names = dict.fromkeys(
        name for window in validation.windows for name in window.covariates if name.startswith(SCALAR)
    )
    with BagWriter(path) as bag:
        bag.add_topic(TOPIC, RESIDUAL_TYPE, RESIDUAL_DEFINITION)
        for name in names:
            bag.add_topic(name.removeprefix(SCALAR), FLOAT64.name, FLOAT64.definition, type_hash=FLOAT64.type_hash)
        for time, topic, data in heapq.merge(
            _residuals(validation), _scalars(validation), key=lambda message: message[0]
        ):
            bag.write(topic, time, data)
    return path


def _residuals(validation: LiveValidation) -> Iterator[tuple[int, str, bytes]]:
    for model, window, mean, covariance in validation.residuals():
        yield window.end, TOPIC, serialize_message(residual_message(model, window, mean, covariance))


def _scalars(validation: LiveValidation) -> Iterator[tuple[int, str, bytes]]:
    for window in validation.windows:
        for name, value in window.covariates.items():
            if name.startswith(SCALAR):
                row = np.array([[value]])
                (data,) = encode(np.array([window.start]), row, SCALAR_LAYOUTS[FLOAT64.name])
                yield window.start, name.removeprefix(SCALAR), data


def residual_message(model: str, window: PushWindow, mean: Array, covariance: Array) -> PushResidual:
    """A window and its prediction (3,), (3, 3). Raises MessageError for a covariance that is not positive definite."""
    inputs = np.array([window.velocity, window.contact, window.angle])
    observed, name = window.displacement, window.push_id
    return residual_to_message(
        ValidatedWindow(window.end, name, window.index, model, inputs, window.duration, mean, covariance, observed)
    )

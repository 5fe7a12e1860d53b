"""The recording of residuals that a validator leaves: a bag of push_residual."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rclpy.serialization import serialize_message

from msg_adapters.residual_schema import RESIDUAL_DEFINITION, RESIDUAL_TYPE
from msg_adapters.residuals import ValidatedWindow, residual_to_message
from push_predictor.evaluation.live_validation import LiveValidation
from push_predictor.recordings.bag_writer import BagWriter
from push_predictor.recordings.windows import PushWindow
from push_predictor.types import Array
from push_predictor_interfaces.msg import PushResidual

TOPIC = "push_residual"
BAG = "residuals"


def write_residuals(validation: LiveValidation, folder: Path) -> Path:
    """Write FOLDER/residuals, a rosbag2 folder with a message for every answer. Raises RecordingError."""
    path = folder / BAG
    with BagWriter(path) as bag:
        bag.add_topic(TOPIC, RESIDUAL_TYPE, RESIDUAL_DEFINITION)
        for model, window, mean, covariance in validation.residuals():
            bag.write(TOPIC, window.end, serialize_message(residual_message(model, window, mean, covariance)))
    return path


def residual_message(model: str, window: PushWindow, mean: Array, covariance: Array) -> PushResidual:
    """A window and its prediction (3,), (3, 3). Raises MessageError for a covariance that is not positive definite."""
    inputs = np.array([window.velocity, window.contact, window.angle])
    observed, name = window.displacement, window.push_id
    return residual_to_message(
        ValidatedWindow(window.end, name, window.index, model, inputs, window.duration, mean, covariance, observed)
    )

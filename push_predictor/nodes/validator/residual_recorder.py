# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The residuals of a finished validation as a bag: a push_residual for every prediction, and the windows' scalars."""

from __future__ import annotations

import heapq
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rclpy.serialization import serialize_message

from msg_adapters.residual_schema import RESIDUAL_DEFINITION, RESIDUAL_TYPE
from msg_adapters.residuals import ValidatedWindow, residual_to_message
from push_predictor.online.files.residual_journal import JOURNAL
from push_predictor.online.live_validation import LiveValidation
from push_predictor.recordings.bag.cdr import SCALAR_LAYOUT, encode
from push_predictor.recordings.bag.message_types import FLOAT64
from push_predictor.recordings.bag.writer import BagWriter
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.types import Array
from push_predictor_interfaces.msg import PushResidual

TOPIC = "push_residual"
BAG = "residuals"
SCALAR = "topic:"  # begins the name of a scalar topic's covariate


def write_residuals(validation: LiveValidation, folder: Path) -> Path:
    """Write FOLDER/residuals, a rosbag2 folder, and remove the journal of the same residuals.

    One message per prediction at the window's end, one per scalar at the window's start. Raises RecordingError.
    """
    path = folder / BAG
    names = dict.fromkeys(
        name for window in validation.windows for name in window.covariates if name.startswith(SCALAR)
    )
    with BagWriter(path) as bag:
        bag.add_topic(TOPIC, RESIDUAL_TYPE, RESIDUAL_DEFINITION)
        for name in names:
            bag.add_topic(_topic(name), FLOAT64.name, FLOAT64.definition, type_hash=FLOAT64.type_hash)
        by_time = heapq.merge(_residuals(validation), _scalars(validation), key=lambda message: message[0])
        for time, topic, data in by_time:
            bag.write(topic, time, data)
    (folder / JOURNAL).unlink(missing_ok=True)
    return path


def residual_message(model: str, window: PushWindow, mean: Array, covariance: Array, in_domain: bool) -> PushResidual:
    """The message of a window and its prediction (3,), (3, 3), made in or out of the model's domain.

    Raises MessageError for a covariance that is not positive definite.
    """
    inputs = np.array([window.velocity, window.contact, window.angle])
    return residual_to_message(
        ValidatedWindow(
            stamp_ns=window.end,
            push_id=window.push_id,
            window=window.index,
            model=model,
            inputs=inputs,
            duration=window.duration,
            predicted=mean,
            covariance=covariance,
            observed=window.displacement,
            in_domain=in_domain,
        )
    )


def _residuals(validation: LiveValidation) -> Iterator[tuple[int, str, bytes]]:
    for residual in validation.residuals():
        yield residual.window.end, TOPIC, serialize_message(residual_message(*residual))


def _scalars(validation: LiveValidation) -> Iterator[tuple[int, str, bytes]]:
    for window in validation.windows:
        for name, value in window.covariates.items():
            if name.startswith(SCALAR):
                row = np.array([[value]])
                (data,) = encode(np.array([window.start]), row, SCALAR_LAYOUT)
                yield window.start, _topic(name), data


def _topic(covariate: str) -> str:
    """The topic of a scalar: a player cannot publish /state.volts[0], so this becomes /state/volts_0."""
    return re.sub(r"\[(\d+)\]", r"_\1", covariate.removeprefix(SCALAR)).replace(".", "/")

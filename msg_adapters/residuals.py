# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A validated window -> push_predictor_interfaces/PushResidual."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from msg_adapters import MessageError
from msg_adapters.stamps import ns_to_stamp
from push_predictor.types import Array
from push_predictor_interfaces.msg import PushResidual


@dataclass(frozen=True, eq=False)
class ValidatedWindow:
    """One window, predicted and observed.

    stamp_ns: end of the window, ns. window: number within the push. inputs (3,): velocity m/s, contact, angle rad;
    duration s. predicted and observed (3,): dx m, dy m, dtheta rad in the push frame; covariance (3, 3) of an
    observed outcome. in_domain: whether the push is in the domain of the model's training data.
    """

    stamp_ns: int
    push_id: str
    window: int
    model: str
    inputs: Array
    duration: float
    predicted: Array
    covariance: Array
    observed: Array
    in_domain: bool

    @property
    def standardised(self) -> Array:
        """L^-1 (observed - predicted), (3,), with L L' = covariance. Raises MessageError if there is no such L."""
        try:
            factor = np.linalg.cholesky(self.covariance)
        except np.linalg.LinAlgError:
            raise MessageError("covariance", self.covariance.tolist(), "a positive definite matrix") from None
        return np.asarray(np.linalg.solve(factor, self.observed - self.predicted))


def residual_to_message(window: ValidatedWindow, frame_id: str = "world") -> PushResidual:
    """The message of a window. Raises MessageError for a covariance that is not positive definite."""
    message = PushResidual(push_id=window.push_id, window=int(window.window), model=window.model)
    message.header.stamp, message.header.frame_id = ns_to_stamp(window.stamp_ns), frame_id
    message.velocity, message.contact, message.angle = (float(value) for value in window.inputs)
    message.duration = float(window.duration)
    message.predicted, message.observed = _flat(window.predicted), _flat(window.observed)
    message.covariance, message.standardised = _flat(window.covariance), _flat(window.standardised)
    message.in_domain = window.in_domain
    return message


def _flat(values: Array) -> Array:
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1)

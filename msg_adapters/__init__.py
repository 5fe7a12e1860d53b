# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Conversion between ROS messages and the library's own types: pure functions, without state or node.

Reading accepts rclpy messages and any object with the same fields, such as rosbags and mcap decoders return;
writing returns rclpy messages.
"""

from __future__ import annotations

from push_predictor.errors import PushPredictorError


class MessageError(PushPredictorError):
    """A message contains a value that is not accepted; the text names the field, the value and what is accepted."""

    def __init__(self, field: str, value: object, accepted: str) -> None:
        super().__init__(f"{field}: {value!r} is not accepted, give {accepted}")
        self.field = field

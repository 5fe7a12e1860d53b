# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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

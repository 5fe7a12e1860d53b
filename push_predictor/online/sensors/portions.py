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
"""Portions of live streams, joined."""

from __future__ import annotations

from push_predictor.recordings.streams import PoseStream

CLOCK_SET = 1_000_000_000  # ns by which stamps go back where a replay loops


def set_back(before: PoseStream, after: PoseStream) -> bool:
    """Whether the clock was set back between two portions."""
    return len(before) > 0 and len(after) > 0 and int(before.stamp[-1]) - int(after.stamp[0]) > CLOCK_SET

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

"""Supports on few points, whose limit surfaces have flats."""

from __future__ import annotations

import numpy as np

from push_predictor.models.mechanics.pressure import supported_at

THREE_POINTS = supported_at(np.array([[0.04, 0.03, 0.3], [-0.04, 0.03, 0.3], [0.0, -0.04, 0.4]]))
FOUR_POINTS = supported_at(np.array([[0.04, 0.04, 0.3], [-0.04, 0.04, 0.2], [-0.04, -0.04, 0.3], [0.04, -0.04, 0.2]]))
TWO_POINTS = supported_at(np.array([[0.03, 0.03, 1.0], [-0.03, -0.03, 1.0]]))

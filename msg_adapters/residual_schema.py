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

"""The definition of PushResidual that a bag of residuals contains, so that any tool can read it."""

from __future__ import annotations

from push_predictor.recordings.bag.definitions import HEADER_DEFINITION

RESIDUAL_TYPE = "push_predictor_interfaces/msg/PushResidual"
RESIDUAL_DEFINITION = f"""std_msgs/Header header
string push_id
uint32 window
string model
float64 velocity
float64 contact
float64 angle
float64 duration
float64[3] predicted
float64[9] covariance
float64[3] observed
float64[3] standardised
bool in_domain
{HEADER_DEFINITION}"""

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The definition of PushResidual that a bag of residuals contains, so that any tool can read it."""

from __future__ import annotations

from push_predictor.recordings.bag.message_types import HEADER_DEFINITION

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

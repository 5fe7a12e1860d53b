# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""From messages to samples, for bags and live topics alike: fields, frames, units, the sensor's zero, rules."""

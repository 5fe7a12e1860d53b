# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The force of a recording: whether it is there, its clock, zero, unit, sign and axes."""

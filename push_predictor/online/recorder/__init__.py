# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Record the streams of a rig into a bag while they arrive, and report what has been recorded."""

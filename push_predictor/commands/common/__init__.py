# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What all commands share: options, output, progress."""

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What all commands share: how they are declared, options, output, progress."""

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Reading damaged bags: `fuzz_bags` is a script, `bag_damage` makes the damaged copies."""

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Model files: how models are saved, loaded and found by name; `model_file`, `table_cache` and `model_registry`."""

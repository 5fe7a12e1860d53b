# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ladder of fitted mechanics for readers: held-out scores of its steps, as text, JSON and a page."""

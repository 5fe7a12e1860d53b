# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The page of `push_predictor check`: answer, tracks, contacts on the outline, findings, coverage. Import `page`."""

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pushes are integrated and simulated less finely than for a user: the errors are far below these tests' noise."""

from __future__ import annotations

from coarse import coarsely

__all__ = ["coarsely"]

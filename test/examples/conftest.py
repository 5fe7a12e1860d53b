# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings are simulated less finely than for a user."""

from __future__ import annotations

from coarse import coarsely

__all__ = ["coarsely"]

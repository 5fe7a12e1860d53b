# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Where the repository is, for tests that read its files or run its commands."""

from __future__ import annotations

from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
BAGS = REPOSITORY / "bags"

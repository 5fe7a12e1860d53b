# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Truths of the independent rigs: their groups by share, the size of a change in units of the noise, their files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from benchmarks.support.plane import Array


def group_at(shares: Mapping[str, float], place: float) -> str:
    """The group at `place` in [0, 1) of the groups' shares."""
    ends = np.cumsum(list(shares.values()))
    return list(shares)[int(np.searchsorted(ends, place * ends[-1], side="right"))]


def change_over_noise(changed: Array, unchanged: Array, other_noise: Array) -> float:
    """Root-mean-square change of outcomes (n, 3) in units of their difference between two draws of the noise."""
    squares = [np.sum((outcomes - unchanged) ** 2, axis=0) for outcomes in (changed, other_noise)]
    return float(np.sqrt(np.mean(squares[0] / squares[1])))


def write_truth(path: Path, truth: Mapping[str, object]) -> None:
    """Write a truth file; an interrupted run leaves none that is not whole."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_suffix(".part")
    draft.write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")
    draft.replace(path)

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Repairs of imported streams: headings, repeated stamps and positions, precision of the clock."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from push_predictor.geometry.frames import wrap_angle
from push_predictor.recordings.importers.cleaning import Samples, in_order, nanoseconds, repair_heading, without_repeats
from push_predictor.recordings.importers.mcube import headings
from push_predictor.recordings.importers.staging import Notes


def _jumping(size: float, spread: int, at: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, the true heading and one with a jump of `size` over `spread` intermediate samples."""
    time = 0.004 * np.arange(120)
    true = 0.3 + 0.8 * time
    steps = np.clip((np.arange(120) - at + 1) / (spread + 1), 0.0, 1.0)
    return time, true, true + size * steps


@pytest.mark.parametrize("spread", [0, 2])
@pytest.mark.parametrize("quarters", [-1, 1, 2])
def test_heading_jump_by_quarter_turns_is_undone_on_a_square(quarters: int, spread: int) -> None:
    time, true, jumping = _jumping(quarters * np.pi / 2, spread)
    repair = repair_heading(time, jumping, symmetry=4)
    difference = (repair.heading - true)[repair.keep]
    assert repair.undone == 1 and repair.cut == 0
    assert np.sum(~repair.keep) == spread
    assert np.ptp(difference) < 0.05, "one heading, off by whole turns of the symmetry at most"


def test_heading_jump_against_the_symmetry_keeps_the_longer_piece() -> None:
    time, _, jumping = _jumping(np.pi / 2, spread=1, at=40)
    repair = repair_heading(time, jumping, symmetry=6)
    kept = np.flatnonzero(repair.keep)
    assert repair.cut == 1 and repair.undone == 0
    assert kept[0] >= 40 and kept[-1] == 119 and len(kept) == kept[-1] - kept[0] + 1


def test_ellipse_is_symmetric_under_half_turns_and_circle_under_all() -> None:
    for size, symmetry in ((np.pi, 2), (np.pi / 2, 0)):
        time, _, jumping = _jumping(size, spread=0)
        assert repair_heading(time, jumping, symmetry).undone == 1
    assert repair_heading(*_jumping(np.pi / 2, spread=0)[::2], 2).cut == 1


@given(st.floats(-12.0, 12.0), st.floats(-10.0, 10.0))
def test_continuous_heading_is_kept_over_many_turns(start: float, speed: float) -> None:
    time = 0.004 * np.arange(300)
    true = start + speed * time
    repair = repair_heading(time, wrap_angle(true), symmetry=4)
    assert np.all(repair.keep) and repair.undone == repair.cut == 0
    np.testing.assert_allclose(np.diff(repair.heading), np.diff(true), atol=1e-9)


def test_rows_are_sorted_without_repeated_stamps_and_both_are_reported() -> None:
    notes = Notes()
    samples = Samples(np.array([10, 30, 20, 20, 40]), np.array([[1.0], [3.0], [2.0], [9.0], [np.nan]]))
    clean = in_order(samples, "FILE", notes)
    assert clean.stamp.tolist() == [10, 20, 30] and clean.values[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert any("1 rows out of order" in line for line in notes.repaired)
    assert any("NaN or infinity" in line for line in notes.dropped) and any(
        "repeat the stamp" in line for line in notes.dropped
    )


def test_only_the_first_of_repeated_positions_is_kept() -> None:
    x = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 2.0, 3.0, 4.0, 4.0])
    kept = without_repeats(Samples(np.arange(14), x[:, None]), "tip", Notes())
    assert kept.stamp.tolist() == [0, 2, 4, 6, 8, 11, 12]


def test_rest_is_kept_in_a_stream_without_repeated_positions() -> None:
    x = np.concatenate([np.zeros(9), np.arange(1.0, 20.0), np.full(9, 19.0)])
    assert len(without_repeats(Samples(np.arange(37), x[:, None]), "tip", Notes()).stamp) == 37


@given(st.floats(1.0e9, 2.0e9))
def test_unix_seconds_keep_their_precision(seconds: float) -> None:
    assert abs(float(nanoseconds(np.array([seconds]))[0] / 10**9) - seconds) < 3e-7


@given(st.floats(-2.5, 2.5), st.floats(0.5, 3.0))
def test_heading_is_recovered_without_the_sign_of_qw(start: float, turned: float) -> None:
    true = np.linspace(start, start + turned, 600)
    quaternion = np.column_stack([np.zeros(600), np.zeros(600), np.sin(true / 2)])
    np.testing.assert_allclose(headings(quaternion), true, atol=1e-6)

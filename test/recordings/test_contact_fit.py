# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Where the contacts of a recording lie against its outline, and how much of their time became windows."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mistakes import outline_scaled, stream_part
from repository import REPOSITORY

from push_predictor.recordings.checks.coverage import ContactFit, contact_fit
from push_predictor.recordings.checks.motion import motion_of
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table

APOTHEM = 0.0605 * np.sqrt(0.75)  # m, of the hexagon


@cache
def hexagon() -> Recording:
    return read_recording(REPOSITORY / "bags" / "hexagon_delrin")


def fit_of(recording: Recording, rig: Rig) -> ContactFit:
    fit = contact_fit(motion_of(recording, rig), rig)
    assert fit is not None
    return fit


@pytest.mark.parametrize("size", [0.96, 1.04])
def test_gaps_have_the_size_and_sign_of_the_outlines_error(size: float) -> None:
    fit = fit_of(hexagon(), outline_scaled(require_rig(hexagon()), size))
    assert fit.side == "side" and len(fit.gaps) == 6
    for gap in fit.gaps:
        assert gap == pytest.approx(APOTHEM * (1.0 - size), abs=2e-4)
    assert (fit.inside > 0.99, fit.off > 0.99) == (size > 1.0, size < 1.0)
    assert min(fit.inside, fit.off) == 0.0


def test_contacts_of_a_sound_outline_are_neither_inside_nor_off_it() -> None:
    fit = fit_of(hexagon(), require_rig(hexagon()))
    assert max(fit.inside, fit.off) < 0.01
    assert all(gap is not None and abs(gap) < 2e-4 for gap in fit.gaps)


def test_a_side_without_contact_has_no_gap() -> None:
    """The bag begins with pushes on some sides."""
    half = replace(hexagon(), slider=stream_part(hexagon().slider, 0.0, 0.3))
    fit = fit_of(half, require_rig(hexagon()))
    assert 0 < sum(gap is None for gap in fit.gaps) < 6
    assert fit.lost is None and fit.window_time is None


def test_the_time_in_contact_is_that_of_the_samples_without_dropouts() -> None:
    fit = fit_of(hexagon(), require_rig(hexagon()))
    assert fit.contact_time == pytest.approx(fit.samples / 100.0, rel=0.02)
    slider = hexagon().slider
    gone = np.ones(len(slider), dtype=np.bool_)
    gone[400:700] = False
    cut = replace(slider, **{name: values[gone] for name, values in vars(slider).items()})
    fewer = fit_of(replace(hexagon(), slider=cut), require_rig(hexagon()))
    assert fewer.contact_time == pytest.approx(fewer.samples / 100.0, rel=0.02)


def test_windows_use_the_time_in_contact_but_for_the_ends_of_pushes() -> None:
    rig = require_rig(hexagon())
    table = windows_to_table(find_windows(hexagon(), rig))
    fit = contact_fit(motion_of(hexagon(), rig), rig, table)
    assert fit is not None and fit.window_time == pytest.approx(0.2 * len(table)) and fit.lost is not None
    assert 0.0 < fit.lost < 0.2 * len(table.pushes) / fit.contact_time
    half = contact_fit(motion_of(hexagon(), rig), rig, table.take(np.arange(len(table)) < len(table) // 2))
    assert half is not None and half.lost == pytest.approx(0.5 + 0.5 * fit.lost, abs=0.02)


def test_a_recording_without_contact_has_no_fit() -> None:
    slider = hexagon().slider
    still = replace(slider, x=0.0 * slider.x, y=0.0 * slider.y, heading=0.0 * slider.x)
    rig = require_rig(hexagon())
    assert contact_fit(motion_of(replace(hexagon(), slider=still), rig), rig) is None

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Contact by the geometry where the force cannot show it: late, early, rare, faint, constant or missing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from checked_bags import bag
from contact_portions import samples_at
from mistakes import force_scaled, late
from synthetic import windows_of

from push_predictor.recordings.read import require_rig
from push_predictor.recordings.streams import PoseStream, Recording, taken
from push_predictor.recordings.windows.contact import SLOWEST
from push_predictor.recordings.windows.finder import WindowFinder
from push_predictor.recordings.windows.force import FEWEST, UNSEEN, ForceTiming, force_delay

NAME = "ellipse_plywood"  # 15 pushes
MANY = "square_abs_repeats"  # 80 pushes


def delayed(recording: Recording, seconds: float) -> Recording:
    wrench = recording.wrench
    return replace(recording, wrench=replace(wrench, stamp=wrench.stamp + round(1e9 * seconds)))


def at_rate(recording: Recording, rate: float) -> Recording:
    wrench = recording.wrench
    stamp = np.arange(wrench.stamp[0], wrench.stamp[-1], round(1e9 / rate))
    values = {name: np.interp(stamp, wrench.stamp, getattr(wrench, name)) for name in ("fx", "fy", "torque")}
    return replace(recording, wrench=replace(wrench, stamp=stamp, **values))


def ids(recording: Recording) -> set[str]:
    return {window.push_id for window in windows_of(recording)}


def later_pushes(recording: Recording) -> tuple[np.ndarray, int]:
    """First starts (n,) s of the pushes after the seventh of the sound recording, and the number of their windows.

    The pushes before show that the force is wrong.
    """
    windows = windows_of(bag(NAME))
    until = sorted(window.start for window in windows if window.index == 0)[FEWEST + 2] - 100_000_000
    later = [window for window in windows_of(recording) if window.start > until]
    return np.array([1e-9 * window.start for window in later if window.index == 0]), len(later)


@pytest.mark.parametrize(
    "alter",
    [
        lambda recording: delayed(recording, 0.12),
        lambda recording: delayed(recording, -0.12),
        lambda recording: force_scaled(recording, 0.02),
        lambda recording: force_scaled(recording, 0.0),
        lambda recording: replace(recording, wrench=taken(recording.wrench, slice(3))),
    ],
    ids=["late", "early", "faint", "silent", "ended"],
)
def test_windows_are_those_of_the_geometry_where_the_force_does_not_show_contacts(
    alter: Callable[[Recording], Recording],
) -> None:
    (expected, windows), (found, count) = later_pushes(bag(NAME)), later_pushes(alter(bag(NAME)))
    assert len(expected) == len(found) == 8
    assert np.median(np.abs(found - expected)) < 0.015 and np.max(np.abs(found - expected)) < 0.06
    assert count == pytest.approx(windows, abs=2)


def test_the_force_decides_where_it_rises_at_the_touch() -> None:
    """A force that rises 10 ms later, at most half the span that determines a window's velocity, is no fault."""
    sound, later = later_pushes(bag(NAME))[0], later_pushes(delayed(bag(NAME), 0.01))[0]
    assert not np.array_equal(sound, later_pushes(replace(bag(NAME), wrench=None))[0])
    assert np.median(later - sound) == pytest.approx(0.01, abs=0.005)


def test_a_force_that_ended_does_not_end_the_windows() -> None:
    sound = bag(NAME)
    wrench = sound.wrench
    third = replace(sound, wrench=taken(wrench, slice(len(wrench) // 3)))
    known = ["normal_force" in window.covariates for window in windows_of(third)]
    assert len(known) == pytest.approx(len(windows_of(sound)), abs=3)
    assert 0.2 < np.mean(known) < 0.5 and known == sorted(known, reverse=True)


def test_windows_without_a_force_reach_the_end_of_the_contact() -> None:
    """Within a window of 0.2 s and two samples, of each push."""
    last = [
        {window.push_id.split("-")[1][:-2]: window.end for window in windows_of(recording)}
        for recording in (bag(NAME), replace(bag(NAME), wrench=None))
    ]
    sound, blind = (sorted(each.values()) for each in last)
    assert len(sound) == len(blind)
    assert abs(np.median(np.array(blind) - np.array(sound))) <= 20_000_000


def test_a_coarse_tracker_does_not_depose_the_force() -> None:
    """Gaps with noise of 1 mm show no touch, so they do not show that the force is late either."""
    rng = np.random.default_rng(0)

    def noisy(recording: Recording) -> Recording:
        slider: PoseStream = recording.slider
        off = rng.normal(0.0, 0.001, len(slider))
        return replace(recording, slider=replace(slider, x=slider.x + off, y=slider.y + off[::-1]))

    finder = WindowFinder(require_rig(bag(NAME)))
    finder.find(noisy(delayed(bag(NAME), 0.12)))
    assert finder.force_touches == []


def test_the_delay_of_the_force_is_measured() -> None:
    for seconds in (0.0, 0.08, -0.08):
        finder = WindowFinder(require_rig(bag(NAME)))
        finder.find(delayed(bag(NAME), seconds))
        found = force_delay([delay for _, delay in finder.force_touches])
        assert found.value == pytest.approx(seconds, abs=0.015) and found.sd < 0.01
        assert found.shifted == found.apart == (seconds != 0.0)


@pytest.mark.parametrize(
    ("delays", "apart"),
    [
        ([0.02] * 4, False),  # too few
        ([0.02] * 5, True),
        ([0.009] * 5, False),
        ([-0.03] * 5, False),
        ([-0.05] * 5, True),
        ([0.0, 0.04, -0.04, 0.03, 0.02], False),  # not clearly late
        ([0.0] * 6 + [np.nan] * 2, False),
        ([0.0] * 4 + [np.nan] * 4, True),
    ],
)
def test_a_force_is_apart_only_if_that_is_clear(delays: list[float], apart: bool) -> None:
    assert force_delay(delays).apart == apart


@pytest.mark.parametrize(("name", "share"), [(NAME, 0.0), (MANY, 0.5)])
def test_a_force_that_falls_silent_costs_three_pushes_at_most(name: str, share: float) -> None:
    """However many touches showed it before."""
    sound, wrench = bag(name), bag(name).wrench
    heard = np.arange(len(wrench)) < share * len(wrench)
    silent = ids(replace(sound, wrench=replace(wrench, fx=heard * wrench.fx, fy=heard * wrench.fy)))
    assert UNSEEN == 3 and len(ids(sound)) - UNSEEN <= len(silent) <= len(ids(sound)) - (not share)


def test_a_clock_of_the_force_that_is_set_is_seen_by_the_last_touches() -> None:
    """Most of all touches were sound: the last 30 decide that the force no longer begins windows."""
    sound, shifted = bag(MANY), delayed(bag(MANY), 0.12)
    half = len(sound.wrench) // 2
    stamp = np.where(np.arange(2 * half) < half, sound.wrench.stamp[: 2 * half], shifted.wrench.stamp[: 2 * half])
    changed = replace(sound, wrench=replace(taken(sound.wrench, slice(2 * half)), stamp=stamp))
    found, expected = ([window.start for window in windows_of(recording)][-10:] for recording in (changed, shifted))
    assert found == expected


def touch_of(length: float, late: float, portion: int) -> float:
    """The delay (s) that is found at a touch of some length (s), of a force that is late (s)."""
    time = 0.01 * np.arange(400)
    after = time - 2.0
    gap = np.where(after < 0.0, -0.05 * after, np.where(after <= length, 0.0, 0.05 * (after - length)))
    force = np.where((after - late > -0.005) & (after - late < length + 0.005), 1.2, 0.02)
    force[np.argmin(np.abs(after - late - 0.5 * length))] = 30.0  # a knock is not the level of the force
    speed = np.where(after < length + 0.1, 0.05, 0.0)
    samples = samples_at(time, gap, force, speed, way=0.05 * np.clip(after, 0.0, length))
    timing = ForceTiming()
    for begin in range(0, len(time), portion):
        part = taken(samples, slice(begin, begin + portion))
        every = np.ones(len(part), dtype=np.bool_)
        timing.take(part, (part.gap < 0.0005) & (part.time > 1.995), every, lambda _: np.zeros((5, 2)), lambda _: 0.3)
    ((_, delay),) = timing.touches
    return delay


@pytest.mark.parametrize("portion", [1, 30, 400])
@pytest.mark.parametrize(
    ("length", "late"),  # s; 1.5 cm at 10 cm/s take 0.15 s; a rise within 0.5 s is seen
    [*product((0.06, 0.15, 0.3, 1.0), (-0.2, 0.0, 0.1)), (0.06, 0.48)],
)
def test_the_force_of_a_short_contact_is_seen(length: float, late: float, portion: int) -> None:
    assert touch_of(length, late, portion) == pytest.approx(late, abs=0.01)


def test_late_poses_do_not_depose_the_force() -> None:
    """The tip reaches the place of a slider at rest when the force rises: of the three, the slider's clock is off."""
    for seconds in (0.035, 0.08):
        finder = WindowFinder(require_rig(bag(MANY)))
        found = finder.find(late(bag(MANY), seconds))
        delay = force_delay([delay for _, delay in finder.force_touches])
        assert delay.touches > FEWEST and not delay.apart
        assert len({window.push_id for window in found}) >= len(ids(bag(MANY))) - 1


def test_a_force_of_another_time_is_apart_from_late_poses_too() -> None:
    for seconds in (0.12, -0.12):
        finder = WindowFinder(require_rig(bag(MANY)))
        finder.find(delayed(late(bag(MANY), 0.035), seconds))
        assert force_delay([delay for _, delay in finder.force_touches]).shifted


@pytest.mark.parametrize(
    "alter", [lambda recording: delayed(recording, 0.12), lambda recording: force_scaled(recording, 0.0)]
)
def test_windows_are_the_same_online(alter: Callable[[Recording], Recording]) -> None:
    """In portions of half a second, the wrench last: the touches so far decide, however the samples arrive."""
    recording = alter(bag(NAME))
    finder = WindowFinder(require_rig(recording))
    first, last = int(recording.slider.stamp[0]), int(recording.slider.stamp[-1])
    found = []
    for begin in range(first - 500_000_000, last + 500_000_000, 500_000_000):
        for add, stream in zip(
            (finder.add_slider, finder.add_pusher, finder.add_wrench), recording.sensors.values(), strict=True
        ):
            add(taken(stream, (stream.stamp >= begin) & (stream.stamp < begin + 500_000_000)))
        found += finder.take_ready()
    found += finder.finish()
    expected = windows_of(recording)
    assert [(window.push_id, window.start) for window in found] == [(each.push_id, each.start) for each in expected]


def test_a_rare_force_begins_and_ends_no_window() -> None:
    """Below 20 Hz its line between two samples begins up to 0.05 s before the touch."""
    assert SLOWEST == 0.05
    blind = [(window.start, window.end) for window in windows_of(replace(bag(NAME), wrench=None))]
    for rate, geometry in ((10.0, True), (19.0, True), (21.0, False)):
        windows = windows_of(at_rate(bag(NAME), rate))
        assert ([(window.start, window.end) for window in windows] == blind) == geometry

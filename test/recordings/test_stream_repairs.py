# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Repairs of a stream, each by itself: what it changes, and what it leaves as it was measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from checked_bags import bag
from stream_faults import at_rate, extrapolated, flipped, in_bursts, lost, rounded
from stream_faults import held as held_poses

from push_predictor.recordings.streams import PoseStream, joined, taken
from push_predictor.recordings.windows.flips import HeadingFlips
from push_predictor.recordings.windows.regular_stamps import RegularStamps, burst_period, missing_in_bursts, stamp_noise
from push_predictor.recordings.windows.resolution import SPEED_ERROR, Resolution, SmoothedPoses, fit_span
from push_predictor.recordings.windows.slow import SlowPoses
from push_predictor.recordings.windows.stamp_order import OrderedSamples, uninterrupted
from push_predictor.recordings.windows.track import Track
from push_predictor.recordings.windows.unmeasured import ContinuedPoses, HeldPoses
from push_predictor.types import Array, IntArray

MS = 1_000_000
MM = 1e-3


def samples(x: Array, period: float = 10.0, quantum: float = 0.0) -> OrderedSamples:
    """Samples of a body at places x (n,) m on a line, as the repairs get them; period in ms."""
    none = np.zeros(len(x))
    values = np.column_stack([x, none, none, none, none + quantum])
    return uninterrupted(times(len(x), period), values)


def times(count: int, period: float = 10.0) -> IntArray:
    return np.rint(period * MS * np.arange(count)).astype(np.int64)


def is_jump(before: Array, after: Array, elapsed: Array) -> Array:
    return Track(4, position=True, angle=3).is_jump(before[:, :4], after[:, :4], elapsed)


def steps(*runs: tuple[int, float]) -> Array:
    """Places that begin at 0 and change by so many times a step (mm)."""
    return MM * np.cumsum([0.0, *(step for count, step in runs for _ in range(count))])


# --- stale poses ------------------------------------------------------------------------------------------------------


def held(x: Array, quantum: float = 0.0) -> tuple[OrderedSamples, OrderedSamples]:
    """What is recorded, and what is left of it."""
    recorded = samples(x, quantum=quantum)
    return recorded, HeldPoses(3).take(recorded, final=True)


@pytest.mark.parametrize(
    ("x", "quantum"),
    [
        (steps((30, 0.0), (1, 200.0), (30, 1.0)), 0.0),  # put elsewhere: farther than it moves afterwards
        (steps(*[(9, 0.0), (1, 1.0)] * 20), MM),  # a slow motion in coarse steps
        (steps((120, 0.0), (1, 2.0), (30, 0.5)), 0.0),  # at rest for longer than a source is silent
        (steps((20, 1.0), (1, 0.0), (1, 0.9), (20, 0.1)), 0.0),  # slower than before
        (steps((20, 0.5), (20, 0.0), (1, 100.0), (150, 0.0), (1, 1000.0), (20, 0.5)), 0.0),  # put elsewhere twice
        (steps((100, 0.0), (150, 0.5), (150, 0.0)), 0.0),  # at rest, without noise
    ],
)
def test_poses_that_may_be_measured_stay(x: Array, quantum: float) -> None:
    recorded, left = held(x, quantum)
    assert np.array_equal(left.stamp, recorded.stamp) and np.array_equal(left.values, recorded.values)


def test_stale_poses_of_a_slow_source_are_on_the_line_to_the_next_and_those_of_a_lost_body_are_no_poses() -> None:
    moves = steps((99, 0.5))
    slow, left = held(np.repeat(moves[::3], 3)[: len(moves)])
    inside = slice(0, 95)
    assert np.array_equal(left.stamp, slow.stamp)
    np.testing.assert_allclose(left.values[inside, 0], moves[inside], atol=1e-9)
    lost = moves.copy()
    lost[41:50] = lost[40]
    assert np.array_equal(held(lost)[1].stamp, np.delete(times(len(moves)), slice(41, 50)))


@pytest.mark.parametrize("portion", [1, 7])
def test_what_is_stale_does_not_depend_on_the_portions(portion: int) -> None:
    rng = np.random.default_rng(0)
    runs = [(int(rng.integers(1, 20)), float(rng.choice([0.0, 0.5, 1.0]))) for _ in range(60)]
    recorded = samples(np.concatenate([steps(*runs), steps((150, 0.0)) + 5.0, steps((20, 0.5)) + 7.0]))
    taker, parts = HeldPoses(3), []
    for first in range(0, len(recorded.stamp), portion):
        rows = slice(first, first + portion)
        parts.append(taker.take(taken(recorded, rows), final=first + portion >= len(recorded.stamp)))
    whole = HeldPoses(3)
    left = whole.take(recorded, final=True)
    assert np.array_equal(np.concatenate([part.stamp for part in parts]), left.stamp)
    assert np.array_equal(np.concatenate([part.values for part in parts]), left.values)
    assert taker.stale == whole.stale > 0 and taker.dropouts == whole.dropouts != []


# --- flips ------------------------------------------------------------------------------------------------------------


def flips(heading: Array, period: float = 10.0, x: Array | None = None, stamp: IntArray | None = None) -> Array:
    x = np.zeros(len(heading)) if x is None else x
    stamp = times(len(heading), period) if stamp is None else stamp
    return HeadingFlips().take(stamp, np.column_stack([x, 0.0 * x, heading]))


def turned(count: int, begin: int, end: int, turn: float = np.pi) -> Array:
    found = np.zeros(count)
    found[begin:end] = turn
    return found


def test_a_flip_ends_with_a_flip_back_whatever_its_way() -> None:
    heading = turned(60, 10, 20, np.pi / 2) + turned(60, 15, 20, np.pi / 2) + turned(60, 20, 60, 2.0 * np.pi)
    found = flips(heading)
    assert np.all(found[10:20] != 0.0) and not found[:10].any() and not found[20:].any()


def test_a_body_that_seems_flipped_for_long_has_this_heading() -> None:
    assert np.array_equal(np.flatnonzero(flips(turned(400, 50, 400))), np.arange(50, 150))


def test_a_gap_or_another_place_ends_a_flip() -> None:
    stamp = times(60)
    stamp[30:] += 160 * MS
    assert np.array_equal(np.flatnonzero(flips(turned(60, 20, 60), stamp=stamp)), np.arange(20, 30))
    x = np.where(np.arange(60) < 30, 0.0, 0.05)
    assert np.array_equal(np.flatnonzero(flips(turned(60, 20, 60), x=x)), np.arange(20, 30))
    assert not flips(turned(60, 30, 60), stamp=stamp).any()  # turned in the gap


def test_a_body_that_is_pushed_fast_stays_in_its_place_between_two_samples() -> None:
    assert np.all(flips(turned(60, 20, 40), period=20.0, x=0.003 * np.arange(60))[20:40] != 0.0)


# --- continued poses --------------------------------------------------------------------------------------------------


def body(x: Array) -> PoseStream:
    return PoseStream(times(len(x)), x, 0.0 * x, 0.0 * x, 0.0 * x)


def measured(count: int = 100) -> Array:
    return steps((count - 1, 0.5)) + 5e-5 * np.random.default_rng(0).standard_normal(count)


def on_a_line(x: Array, begin: int, count: int) -> Array:
    x = x.copy()
    x[begin : begin + count] = x[begin - 1] + 4e-4 * np.arange(1, count + 1)
    return x


def continued(x: Array) -> list[int]:
    """The samples that are left out."""
    step, rows = ContinuedPoses(None), np.column_stack([x, np.zeros((len(x), 2)), Resolution(1).take(x[:, None])])
    kept = step.take(uninterrupted(body(x).stamp, rows), final=True).stamp
    lost = np.flatnonzero(~np.isin(body(x).stamp, kept)).tolist()
    assert step.lost == len(lost)
    return lost


@pytest.mark.parametrize("portion", [1, 7])
def test_continued_poses_are_left_out_portion_by_portion(portion: int) -> None:
    """From the first on, where a coincidence is excluded."""
    stream = body(on_a_line(on_a_line(on_a_line(measured(200), 20, 4), 50, 6), 120, 30))
    rows = np.column_stack([stream.x, stream.y, np.zeros((200, 2))])
    step, found = ContinuedPoses(None), []
    for begin in range(0, 200, portion):
        now = slice(begin, begin + portion)
        found.append(step.take(uninterrupted(stream.stamp[now], rows[now])))
        assert step.waiting <= 31
    found.append(step.take(uninterrupted(stream.stamp[:0], rows[:0]), final=True))
    left_out = [*range(50, 56), *range(120, 150)]
    assert continued(stream.x) == left_out and (step.lost, step.runs) == (36, 2) and step.waiting == 0
    assert np.array_equal(np.concatenate([each.stamp for each in found]), np.delete(stream.stamp, left_out))


def test_a_line_of_over_two_seconds_is_a_motion_and_is_not_waited_for() -> None:
    stream = body(on_a_line(measured(400), 50, 300))
    rows = np.column_stack([stream.x, stream.y, np.zeros((400, 2))])
    step = ContinuedPoses(None)
    given = [step.take(uninterrupted(stream.stamp[k : k + 1], rows[k : k + 1])) for k in range(300)]
    assert step.waiting <= 1 and sum(len(each.stamp) for each in given) >= 299
    assert not continued(stream.x)


def test_repeated_and_rounded_poses_and_a_steady_motion_without_noise_are_not_continued() -> None:
    assert not continued(steps((100, 0.0), (100, 0.5), (100, 0.0)))
    still = measured()
    still[50:70] = still[50]
    assert not continued(still)
    counts = [*np.random.default_rng(0).integers(0, 4, 80), *[1] * 12, 9, 0]
    assert not continued(MM * np.cumsum(counts))


def test_poses_on_a_line_between_two_measured_ones_are_not_continued() -> None:
    x, inner, ends = measured(), np.arange(50, 58), [49, 58]
    x[inner] = np.interp(inner, ends, x[ends])
    assert not continued(x)


# --- resolution -------------------------------------------------------------------------------------------------------


def resolution(x: Array) -> float:
    return float(Resolution(1).take(x[:, None])[-1, 0])


def test_a_resolution_is_known_from_steps_that_vary() -> None:
    assert resolution(MM * np.cumsum(np.tile([10, 11, 10, 12], 20))) == pytest.approx(MM)  # no step is that small
    assert resolution(MM * np.cumsum([1, 2, 1, 3, 1, 2, 1])) == 0.0  # too few
    assert resolution(steps(*[(8, 0.5), (8, 0.7)] * 13)) == 0.0  # steady motions at some speeds


@pytest.mark.parametrize("step", [1e-3, 2.5e-4, 1e-4])
def test_the_resolution_of_measured_poses_is_that_of_their_decimals(step: float) -> None:
    pusher = bag("ellipse_plywood").pusher
    known = Resolution(2).take(np.column_stack([np.round(pusher.x / step) * step, pusher.y]))[-1]
    assert known[0] == pytest.approx(step, rel=1e-6) and known[1] < 2e-5


def test_a_line_over_the_span_of_a_resolution_has_the_stated_error() -> None:
    rng, step, period = np.random.default_rng(0), 2e-4, 0.01
    time = np.arange(round(float(fit_span(step, period)) / period)) * period
    slopes = [
        np.polyfit(time, np.round((speed * time + rng.uniform(0.0, step)) / step) * step, 1)[0] - speed
        for speed in rng.uniform(0.02, 0.08, 2000)
    ]
    assert 0.3 * SPEED_ERROR < np.std(slopes) < 1.2 * SPEED_ERROR


# --- smoothed poses ---------------------------------------------------------------------------------------------------

COARSE = 4e-4


def smoothed(x: Array) -> Array:
    """Errors (n,) m of the smoothed places of what is rounded to COARSE."""
    recorded = samples(np.round(x / COARSE) * COARSE, quantum=COARSE)
    return np.asarray(np.abs(SmoothedPoses(3).take(recorded, final=True).values[:, 0] - x))


def test_lines_end_where_a_motion_begins() -> None:
    assert smoothed(steps((60, 0.0), (60, 0.5)))[55:65].max() < COARSE


def test_no_line_spans_a_jump() -> None:
    jump = np.where(np.arange(80) < 40, 0.0, 0.1)
    assert smoothed(jump).max() < 1e-9


def test_a_motion_that_changes_all_the_time_keeps_its_lines() -> None:
    time = 0.01 * np.arange(300)
    assert np.sqrt(np.mean(smoothed(0.01 * np.sin(2.0 * np.pi * time)) ** 2)) < 0.4 * COARSE


def test_noise_beyond_the_rounding_is_no_kink() -> None:
    x = steps((400, 0.5))
    recorded = samples(np.round((x + COARSE * np.random.default_rng(0).standard_normal(401)) / COARSE) * COARSE)
    recorded.values[:, -1] = COARSE
    left = SmoothedPoses(3).take(recorded, final=True).values[:, 0] - x
    assert np.std(left) < 0.45 * COARSE


# --- slow streams -----------------------------------------------------------------------------------------------------

SLOW = 50.0  # ms


def filled(recorded: OrderedSamples, angle: int | None = 3) -> OrderedSamples:
    return SlowPoses(is_jump, angle).take(recorded, final=True)


def inside(found: OrderedSamples, begin: int, end: int) -> int:
    """How many poses lie between two stamps (ns)."""
    return int(np.sum((found.stamp > begin) & (found.stamp < end)))


def test_poses_are_put_between_those_of_a_slow_stream_but_not_where_it_breaks() -> None:
    plain = samples(steps((40, 2.0)), SLOW)
    late = plain.stamp + np.where(np.arange(41) < 20, 0, 1000 * MS)
    gap = OrderedSamples(late, plain.values, plain.interrupted)
    jump = samples(steps((19, 2.0), (1, 200.0), (20, 2.0)), SLOW)
    missing = OrderedSamples(plain.stamp, plain.values, np.arange(41) == 20)
    for recorded in (gap, jump, missing):
        found = filled(recorded)
        assert inside(found, int(recorded.stamp[19]), int(recorded.stamp[20])) == 0
        assert inside(found, int(recorded.stamp[20]), int(recorded.stamp[21])) == 4
        assert inside(found, int(recorded.stamp[18]), int(recorded.stamp[19])) == 4
    assert np.array_equal(found.stamp[found.interrupted], [plain.stamp[20]])


@pytest.mark.parametrize(("angle", "period"), [(3, 25.0), (None, 25.0), (None, SLOW)])
def test_a_start_is_placed_between_samples_far_apart(angle: int | None, period: float) -> None:
    """The body starts half an interval before the sample 21."""
    x = steps((20, 0.0), (1, 1.0), (20, 2.0))
    found = filled(samples(x, period), angle)
    middle = round(20.5 * period * MS)
    at_middle = np.interp(middle, found.stamp, found.values[:, 0])
    assert at_middle == pytest.approx(0.0 if period == SLOW else 0.5 * MM, abs=1e-9)
    if angle is None:
        assert len(found.stamp) == len(x) + (period == SLOW)


def test_a_stop_is_placed_and_a_slower_motion_is_none() -> None:
    x = steps((20, 2.0), (1, 1.0), (20, 0.0))
    found = filled(samples(x, SLOW), None)
    assert len(found.stamp) == len(x) + 1
    assert np.interp(20.5 * SLOW * MS, found.stamp, found.values[:, 0]) == pytest.approx(41.0 * MM)
    for after in ([(1, 1.98), (20, 0.0)], [(1, 1.999), (20, 0.0)], [(21, 1.0)]):  # nearly all of an interval; slower
        x = steps((20, 2.0), *after)
        assert len(filled(samples(x, SLOW), None).stamp) == len(x)


def test_a_body_that_turns_off_at_once_is_at_its_end_from_the_turn_on() -> None:
    x, y = steps((20, 2.0), (1, 1.0), (20, 0.0)), steps((20, 0.0), (1, 1.0), (20, 2.0))
    recorded = samples(x, SLOW)
    recorded.values[:, 1] = y
    found = filled(recorded, None)
    (put_in,) = np.flatnonzero(found.stamp % round(SLOW * MS))
    assert np.array_equal(found.values[put_in, :2], recorded.values[21, :2])


def test_poses_that_arrive_together_lie_on_the_line_of_those_that_arrived_soon() -> None:
    true = times(606, 20.0)
    late = np.where(np.arange(606) % 6 < 3, 0, 1) * (19 - 20 * (np.arange(606) % 6 - 3)) * MS
    late[300:305] = (160 - 20 * np.arange(5)) * MS + np.arange(5)  # held up for eight periods
    stamp = np.maximum.accumulate(true + np.maximum(late, 0)) + np.arange(606)
    recorded = uninterrupted(stamp, np.zeros((606, 1)))
    taker, whole = RegularStamps(), RegularStamps().take(recorded, final=True).stamp
    parts = [taker.take(taken(recorded, slice(k, k + 50)), final=k == 600) for k in range(0, 606, 50)]
    assert taker.noise is not None and taker.noise.bursts
    assert np.array_equal(np.concatenate([part.stamp for part in parts]), whole)
    assert np.abs(whole - true).max() < 2 * MS


def test_a_sample_that_is_missing_in_bursts_is_counted() -> None:
    grid = times(101, 20.0)
    assert burst_period(in_bursts(grid)) == pytest.approx(0.02, rel=0.01)
    assert burst_period(grid) is None  # a regular stream
    random = np.cumsum(np.random.default_rng(0).exponential(20.0, 101) * MS).astype(np.int64)
    assert burst_period(random) is None  # no grid
    missing = missing_in_bursts(in_bursts(np.delete(grid, [50, 51])), 0.02)
    assert missing.sum() == 2 and abs(int(np.flatnonzero(missing)[0]) - 50) <= 4
    assert missing_in_bursts(np.delete(grid, [50, 51]), 0.02).sum() == 2  # the steps around it are equal


# --- all of them ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "alter",
    [
        lambda of: of,
        lambda of: lost(of, np.arange(300, 1300, 160), 12),
        lambda of: extrapolated(of, np.arange(300, 1300, 160), 12),
        lambda of: held_poses(of, 30.0),
        lambda of: rounded(of, 2e-4, 1e-3),
        lambda of: rounded(of, 5e-3, 1e-3),
        lambda of: flipped(of, np.arange(300, 1300, 160), 12, np.pi),
        lambda of: at_rate(of, 20.0),
        lambda of: replace(at_rate(of, 50.0), stamp=in_bursts(at_rate(of, 50.0).stamp)),
    ],
)
@pytest.mark.parametrize("portion", [1, 13])
def test_repairs_do_not_depend_on_the_portions(portion: int, alter: Callable[[PoseStream], PoseStream]) -> None:
    stream = alter(taken(bag("ellipse_plywood").slider, slice(1500)))
    rows = np.column_stack([stream.x, stream.y, stream.z, stream.heading])

    def repaired(portion: int) -> OrderedSamples:
        flips, track, parts = HeadingFlips(), Track(4, position=True, angle=3), []
        for begin in range(0, len(rows), portion):
            stamp, values = stream.stamp[begin : begin + portion], rows[begin : begin + portion].copy()
            values[:, 3] -= flips.take(stamp, values[:, [0, 1, 3]])
            parts.append(track.repairs.take(uninterrupted(stamp, values), final=begin + portion >= len(rows)))
        assert track.repairs.waiting == 0
        return joined(parts)

    whole, found = repaired(len(rows)), repaired(portion)
    assert np.array_equal(found.stamp, whole.stamp)
    np.testing.assert_allclose(found.values, whole.values, atol=1e-12)


# --- stamps -----------------------------------------------------------------------------------------------------------


def test_the_noise_of_stamps_is_that_of_the_last_block() -> None:
    rng = np.random.default_rng(0)
    stamp = times(300) + np.where(np.arange(300) < 101, 0, 300_000 * rng.standard_normal(300)).astype(np.int64)
    taker = RegularStamps()
    taker.take(uninterrupted(stamp, np.zeros((300, 1))), final=True)
    assert taker.noise is not None and not taker.corrected
    assert taker.noise.jitter == pytest.approx(3e-4, rel=0.4)


def test_repeated_stamps_have_the_period_of_the_others_and_stamps_without_an_order_stay() -> None:
    noise = stamp_noise(np.repeat(times(100), 3))
    assert noise is not None and noise.period == pytest.approx(0.01)
    lost = stamp_noise(times(100) + (40 * MS * np.random.default_rng(0).standard_normal(100)).astype(np.int64))
    assert lost is not None and lost.jitter > lost.period and not lost.corrected

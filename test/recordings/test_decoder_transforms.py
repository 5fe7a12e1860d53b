# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Transforms in any portions give the poses that reading a recording of them gives."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

pytest.importorskip("rosbags")
from decoding import decoder_of, in_portions
from decoding import put as hand
from lab_bags import Lab, Message, short_recording

from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.decoder import transform_buffer
from push_predictor.recordings.decoder.poses import SET_BACK, PoseFrame
from push_predictor.recordings.decoder.rules import NO_TRANSFORM, PUSHER
from push_predictor.recordings.decoder.transform_buffer import TransformBuffer
from push_predictor.recordings.fields.sources import TF_TYPES, Source
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.topics import Topics
from push_predictor.types import Array, IntArray

MILLISECOND = 1_000_000
START = 1_700_000_000_000 * MILLISECOND


@cache
def original() -> Recording:
    return short_recording(0.6, after=1.0)


def pose_frame(world: str = "", name: str = "tip", tf: TransformBuffer | None = None) -> PoseFrame:
    """The poses of a frame in a buffer of its own, or in a given one."""
    return PoseFrame(Source("pusher_topic", f"/tf:{name}"), PUSHER, TransformBuffer(world) if tf is None else tf)


def put(buffer: TransformBuffer, messages: list[Message]) -> None:
    for sent, topic, data in messages:
        buffer.put(Messages.of(topic, TF_TYPES[0], [sent], [data]), topic == "/tf_static", np.array([sent]))


def taken(frame: PoseFrame, messages: list[Message], portion: int = 40) -> tuple[IntArray, Array]:
    """All poses of a frame, taken after each portion of messages."""
    parts = []
    for first in range(0, len(messages), portion):
        put(frame.tf, messages[first : first + portion])
        parts.append(frame.take(last=first + portion >= len(messages)))
        frame.tf.forget()
    return np.concatenate([stamp for stamp, _ in parts]), np.concatenate([rows for _, rows in parts])


def line(stamps: IntArray, speed: float = 1.0) -> Array:
    """Rows (n, 7) of a motion along x at a constant speed, m/s."""
    n = len(stamps)
    return np.column_stack([speed * (stamps - START) * 1e-9, np.zeros((n, 5)), np.ones(n)])


def every(period: float, begin: int, end: int) -> IntArray:
    """Stamps in ns, all in ms from START."""
    return np.asarray(START + np.arange(begin, end, period) * MILLISECOND, dtype=np.int64)


def cart(coarse: IntArray, fine: IntArray) -> Lab:
    """A tip that moves on a cart that moves, each at 1 m/s."""
    lab = Lab()
    lab.transform("/tf", "world", "cart", coarse, line(coarse))
    lab.transform("/tf", "cart", "tip", fine, line(fine))
    return lab


def test_several_portions_that_are_taken_at_once_stay_in_order() -> None:
    messages = cart(every(20, 0, 1201), every(4, 0, 1201)).in_order()
    tip = pose_frame("world")
    for portion in (messages[:100], messages[100:]):
        times, data = [sent for sent, _, _ in portion], [each for *_, each in portion]
        tip.tf.put(Messages.of("/tf", TF_TYPES[0], times, data), static=False)
    stamp, rows = tip.take()
    assert stamp.tolist() == every(4, 0, 1201).tolist()
    np.testing.assert_allclose(rows[:, 0], 2e-9 * (stamp - START), atol=1e-9)


def test_samples_before_another_transform_began_or_in_its_dropout_are_counted() -> None:
    coarse = every(20, 200, 2000)
    coarse = coarse[(coarse < START + 800 * MILLISECOND) | (coarse > START + 1300 * MILLISECOND)]
    tip = pose_frame("world")
    stamp, _ = taken(tip, cart(coarse, every(4, 0, 2000)).in_order())
    assert tip.rejected[NO_TRANSFORM] > 100
    assert len(stamp) + tip.rejected[NO_TRANSFORM] == tip.received
    assert np.diff(stamp).max() == 540 * MILLISECOND


def test_a_clock_that_is_set_back_begins_anew() -> None:
    first = cart(every(20, 60_000, 62_001), every(4, 60_000, 62_001)).in_order()
    again = cart(every(20, 0, 1001), every(4, 0, 1001)).in_order()
    tip = pose_frame()
    stamp, rows = taken(tip, [*first, *again], portion=50)
    jump = int(np.flatnonzero(np.diff(stamp) < 0)[0]) + 1
    assert jump + len(stamp[jump:]) == len(stamp) and stamp[jump:].tolist() == every(4, 0, 1001).tolist()
    np.testing.assert_allclose(rows[:, 0], 2e-9 * (stamp - START), atol=1e-9)
    waiting = pose_frame()
    put(waiting.tf, cart(every(20, 60_000, 61_001), every(4, 60_000, 61_101)).in_order())
    waiting.take()
    put(waiting.tf, again)
    waiting.take()
    assert waiting.rejected[SET_BACK] == 25, "they waited for the cart"


def test_samples_before_a_clock_that_is_set_back_in_the_first_second_are_counted() -> None:
    tip = pose_frame("world")
    for first, last in ((10_000, 10_500), (0, 1101)):
        put(tip.tf, cart(every(20, first, last), every(4, first, last)).in_order())
        taken_now, _ = tip.take()
    assert len(taken_now) > 200
    assert tip.rejected[SET_BACK] == len(every(4, 10_000, 10_500))


def test_among_equal_transforms_the_nearest_to_the_frame_gives_the_stamps() -> None:
    messages = cart(every(10, 0, 501), every(10, 3, 501)).in_order()
    stamp, _ = taken(pose_frame("world"), messages, portion=1)
    assert len(stamp) > 40 and {*(stamp % (10 * MILLISECOND))} == {3 * MILLISECOND}


@pytest.mark.parametrize("portion", [37, 5000])
def test_the_transform_with_most_samples_in_the_first_second_of_all_gives_the_stamps(portion: int) -> None:
    messages = cart(every(20, 0, 2501), every(4, 1000, 2501)).in_order()
    stamp, rows = taken(pose_frame("world"), messages, portion)
    assert stamp.tolist() == every(4, 1000, 2501).tolist()
    np.testing.assert_allclose(rows[:, 0], 2e-9 * (stamp - START), atol=1e-9)


def test_a_transform_that_becomes_finer_later_does_not_take_over() -> None:
    tip = np.concatenate([every(20, 0, 1500), every(2, 1500, 2501)])
    stamp, _ = taken(pose_frame("world"), cart(every(10, 0, 2501), tip).in_order(), portion=37)
    assert stamp.tolist() == every(10, 0, 2501).tolist()


def test_samples_of_a_frame_without_connection_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transform_buffer, "LIMIT", 100)
    tip, stamps = pose_frame("world"), every(4, 0, 1000)
    lab = Lab()
    lab.transform("/tf", "cart", "tip", stamps, line(stamps))
    taken(tip, lab.in_order())
    assert (tip.dropped, len(tip.tf.histories["tip"].edge.stamp)) == (150, 100)
    unread = TransformBuffer("world")
    put(unread, lab.in_order())
    assert (unread.dropped, unread.unread) == (150, 100)


def test_of_a_silent_frame_only_recent_samples_of_the_others_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transform_buffer, "SILENT", 200 * MILLISECOND)
    monkeypatch.setattr(transform_buffer, "KEPT", 100 * MILLISECOND)
    tip, stamps, lab = pose_frame("world"), every(4, 0, 1001), Lab()
    lab.transform("/tf", "world", "cart", stamps, line(stamps))
    taken(tip, lab.in_order())
    assert tip.tf.histories["cart"].edge.stamp.tolist() == stamps[-76:].tolist()


def test_the_last_static_transform_counts() -> None:
    tip, stamps, lab = pose_frame("world"), every(4, 0, 100), Lab()
    lab.transform("/tf", "cart", "tip", stamps, line(stamps, 0.0))
    lab.transform("/tf_static", "world", "cart", stamps[:2] + 10**6, [line(stamps[:1])[0], [5.0, *[0.0] * 5, 1.0]])
    for message in lab.in_order():
        put(tip.tf, [message])
        tip.recent(1)
    assert tip.take()[1][:, 0] == pytest.approx(5.0) and len(tip.tf.histories["cart"].edge.stamp) == 1


def test_a_decoder_keeps_the_transforms_of_some_seconds() -> None:
    lab = cart(every(40, 0, 12_000), every(10, 0, 12_000))
    decoder = decoder_of(lab, Topics("/tf:cart", "/tf:tip"))
    for portion in in_portions(lab.in_order(), 100):
        hand(decoder, lab, portion)
        decoder.take()
    (buffer,) = decoder.tf.values()
    assert 500 <= len(buffer.histories["tip"].edge.stamp) < 700


def test_a_frame_that_is_not_connected_is_named_until_it_is() -> None:
    tip, stamps = pose_frame("world"), every(4, 0, 100)
    lab = Lab()
    lab.transform("/tf", "cart", "tip", stamps, line(stamps))
    put(tip.tf, lab.in_order())
    assert len(tip.take()[0]) == 0
    assert tip.problem == "no frame 'world'; the frames are cart, tip" and tip.lacks_world
    static = Lab()
    static.transform("/tf_static", "world", "cart", stamps[:1], line(stamps[:1]))
    put(tip.tf, static.in_order())
    assert tip.take(last=True)[0].tolist() == stamps.tolist() and not tip.problem
    assert not tip.lacks_world


def test_a_tree_that_grows_above_its_root_is_reported() -> None:
    tip, stamps = pose_frame(), every(4, 0, 1100)
    lab = Lab()
    lab.transform("/tf", "cart", "tip", stamps, line(stamps))
    put(tip.tf, lab.in_order())
    assert len(tip.take()[0]) == 275 and tip.tf.world == "cart" and not tip.problem
    static = Lab()
    static.transform("/tf_static", "world", "cart", stamps[:1], line(stamps[:1]))
    put(tip.tf, static.in_order())
    assert len(tip.take()[0]) == 0
    assert tip.problem == "poses are given in 'cart', but the root of the tree is now 'world'; set world_frame"


def test_a_frame_with_two_parents_is_refused_by_name() -> None:
    tip, stamps = pose_frame(), every(4, 0, 100)
    for parent in ("cart", "rail"):
        lab = Lab()
        lab.transform("/tf", parent, "tip", stamps, line(stamps))
        put(tip.tf, lab.in_order())
        tip.take()
    assert tip.problem == "frame 'tip' has the parents 'cart' and 'rail', one is accepted"
    assert tip.dropped == len(stamps)


def test_reports_the_newest_stamps_without_taking_them() -> None:
    tip = pose_frame()
    assert len(tip.recent(10)) == 0 and "no frame 'tip'" in tip.problem
    assert not tip.lacks_world
    put(tip.tf, cart(every(20, 0, 1101), every(4, 0, 1101)).in_order())
    waiting = len(tip)
    assert tip.recent(10).tolist() == every(4, 1064, 1101).tolist()
    assert len(tip) == waiting == 332, "they wait as before"
    assert len(tip.take()[0]) == 276 and len(tip) == 0


@pytest.mark.parametrize("portion", [37, 5000])
def test_a_frame_that_was_static_moves_once_it_is_on_tf(portion: int) -> None:
    """Its static pose is one sample of it from then on, and not valid at all times."""
    fine, coarse, lab = every(4, 0, 2001), every(20, 1000, 2001), Lab()
    lab.transform("/tf_static", "world", "cart", every(4, 0, 1), [[5.0, *[0.0] * 5, 1.0]])
    lab.transform("/tf", "world", "cart", coarse, line(coarse))
    lab.transform("/tf", "cart", "tip", fine, line(fine))
    tip = pose_frame("world")
    stamp, rows = taken(tip, lab.in_order(), portion)
    moving = stamp >= coarse[0]
    assert stamp[moving].tolist() == fine[fine >= coarse[0]].tolist()
    np.testing.assert_allclose(rows[moving, 0], 2e-9 * (stamp[moving] - START), atol=1e-9)
    assert not tip.tf.histories["cart"].edge.static


def test_single_stamps_wait_for_the_slowest_of_the_moving_transforms() -> None:
    buffer, stamps = TransformBuffer("world"), START + np.array([400, 480, 520], np.int64) * MILLISECOND
    put(buffer, cart(every(10, 0, 451), every(10, 0, 501)).in_order())
    known, rows = buffer.at("tip", "world", stamps, "wrench")
    assert known.tolist() == [True, False, False]
    np.testing.assert_allclose(rows[:, 0], [0.8])
    put(buffer, cart(every(10, 460, 601), every(10, 510, 516)).in_order())
    known, rows = buffer.at("tip", "world", stamps[1:], "wrench")
    assert known.tolist() == [True, False]
    np.testing.assert_allclose(rows[:, 0], [0.96])
    known, rows = buffer.at("tip", "world", stamps[2:], "wrench", last=True)
    assert known.all() and np.isnan(rows).all(), "the tip ended before"

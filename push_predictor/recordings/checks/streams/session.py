# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The samples of a stream that the checks judge: of one setting of its clock, in order, each once."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.dropouts import CLOCK_SET
from push_predictor.recordings.streams import PoseStream, Recording, Stream, repeated, taken
from push_predictor.recordings.windows.stamp_order import StampOrder
from push_predictor.recordings.windows.track import Track

LEAST_SHARE = 0.05  # of the samples are repeats; single ones are usual


def in_order(stream: Stream) -> Stream:
    """The longest part of a stream between settings of its clock, without samples older than one before."""
    begins = np.concatenate([[0], np.flatnonzero(np.diff(stream.stamp) < -CLOCK_SET) + 1, [len(stream)]])
    longest = int(np.argmax(np.diff(begins)))
    part = taken(stream, slice(int(begins[longest]), int(begins[longest + 1])))
    newest = np.maximum.accumulate(part.stamp)
    newer = np.append(True, part.stamp[1:] > newest[:-1])[: len(part)]
    return part if newer.all() else taken(part, newer)


def of_one_body(stream: PoseStream) -> PoseStream:
    """The samples of a stream without those that jump away and back, as the window finder takes them."""
    order = StampOrder(3, Track(3, position=True).is_jump)
    rows = np.column_stack([stream.x, stream.y, np.arange(len(stream), dtype=np.float64)])
    return taken(stream, order.take(stream.stamp, rows, final=True).values[:, 2].astype(np.int64))


def repeated_samples(recording: Recording) -> Finding | None:
    """A warning if samples are in the recording twice: from two publishers, or from a loop that was recorded."""
    every = {"slider": recording.slider, "pusher": recording.pusher, "wrench": recording.wrench}
    streams = {name: stream for name, stream in every.items() if stream is not None and len(stream)}
    twice = {name: repeated(stream) for name, stream in streams.items()}
    often = {name: again for name, again in twice.items() if np.mean(again) > LEAST_SHARE}
    if not often:
        return None
    listed = ", ".join(f"{name} {100.0 * np.mean(again):.0f} %" for name, again in often.items())
    values = {f"{name}_share": Value(float(np.mean(again)), "1") for name, again in often.items()}
    sentence = f"Samples are recorded twice, with the same stamp and value: {listed}."
    loop = any(bool(np.any(np.diff(streams[name].stamp) < -CLOCK_SET)) for name in often)
    if loop:
        advice = "A loop was recorded. Its windows count once. Record a replay only once."
        return Finding("loop_recorded", "warning", sentence, advice, values)
    advice = "They count once. Stop the second publisher (`ros2 topic info --verbose` lists both)."
    return Finding("sent_twice", "warning", sentence, advice, values)

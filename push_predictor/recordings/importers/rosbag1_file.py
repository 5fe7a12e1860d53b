# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Reading ROS 1 bags with the package `rosbags`: topics, types, messages of chosen topics."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from push_predictor.errors import ImportSourceError, RecordingError
from push_predictor.recordings.bag.ros1_file import DAMAGE, lower_package, opened_ros1
from push_predictor.recordings.importers.cleaning import Samples


class Stamped(NamedTuple):
    """A message and its bag time (ns)."""

    time: int
    message: Any


def bag_topics(path: Path) -> dict[str, str]:
    """Topics and their types, ROS 1 names. Raises ImportSourceError if the bag cannot be opened."""
    with _opened(path) as reader:
        return {c.topic: c.msgtype.replace("/msg/", "/") for c in reader.connections}


def bag_messages(path: Path, topics: Collection[str]) -> dict[str, list[Stamped]]:
    """All messages of the given topics in the bag's order. Raises ImportSourceError if one cannot be read."""
    from rosbags.rosbag1 import ReaderError
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    found: dict[str, list[Stamped]] = {topic: [] for topic in topics}
    with _opened(path) as reader:
        wanted = [c for c in reader.connections if c.topic in found]
        count = 0
        try:
            for c in wanted:
                if (name := lower_package(c.msgtype)) not in store.types:
                    store.register(get_types_from_msg(lower_package(c.msgdef.data), name))
            for c, time, data in reader.messages(connections=wanted):
                found[c.topic].append(Stamped(time, store.deserialize_ros1(data, lower_package(c.msgtype))))
                count += 1
        except (ReaderError, SerdeError, TypesysError, *DAMAGE) as error:
            reason = f"{type(error).__name__}: {error}"
            raise ImportSourceError(f"{path}: message {count} cannot be read ({reason})") from None
    return found


def samples_of(
    messages: Sequence[Stamped], values: Callable[[Any], Sequence[float]], stamp: Callable[[Stamped], int]
) -> Samples:
    """Stamps (n,) and values (n, k) of messages."""
    stamps = np.array([stamp(item) for item in messages], dtype=np.int64)
    rows = np.array([values(item.message) for item in messages], dtype=np.float64)
    return Samples(stamps, rows.reshape(len(stamps), -1))


def bag_time(item: Stamped) -> int:
    """The time at which the bag recorded the message, ns."""
    return item.time


def header_time(item: Stamped) -> int:
    """The header stamp, ns."""
    return int(item.message.header.stamp.sec) * 1_000_000_000 + int(item.message.header.stamp.nanosec)


def header_lead(messages: Sequence[Stamped]) -> tuple[float, float, float]:
    """Header stamp minus bag time, s: minimum, median, maximum."""
    lead = [(header_time(item) - item.time) * 1e-9 for item in messages]
    return float(np.min(lead)), float(np.median(lead)), float(np.max(lead))


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    try:
        with opened_ros1(path) as reader:
            yield reader
    except RecordingError as error:
        raise ImportSourceError(str(error)) from None

"""Reading ROS 1 bags with the package `rosbags`: topics, types, messages of chosen topics."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from push_predictor.errors import ImportSourceError
from push_predictor.recordings.importers.cleaning import Samples

CAPITAL_PACKAGE = re.compile(r"\b([A-Z]\w*)/")  # allowed in ROS 1, not in ROS 2, which rosbags follows
DAMAGE = (OSError, RuntimeError, ValueError, LookupError, AssertionError, EOFError, struct.error)


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
                if (name := _lower_package(c.msgtype)) not in store.types:
                    store.register(get_types_from_msg(_lower_package(c.msgdef.data), name))
            for c, time, data in reader.messages(connections=wanted):
                found[c.topic].append(Stamped(time, store.deserialize_ros1(data, _lower_package(c.msgtype))))
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


def _opened(path: Path) -> Any:
    try:
        from rosbags.rosbag1 import Reader, ReaderError
    except ImportError:
        raise ImportSourceError(f"{path}: ROS 1 bags need the package rosbags (pip install rosbags)") from None
    if not path.is_file():
        raise ImportSourceError(f"{path}: is not a file, give a ROS 1 bag")
    try:
        reader = Reader(path)
        reader.open()
    except (ReaderError, *DAMAGE) as error:
        raise ImportSourceError(f"{path}: the bag cannot be opened ({error})") from None
    return _Closing(reader)


class _Closing:
    """An open reader that closes at the end of a with block."""

    def __init__(self, reader: Any) -> None:
        self.reader = reader

    def __enter__(self) -> Any:
        return self.reader

    def __exit__(self, *_: object) -> None:
        self.reader.close()


def _lower_package(text: str) -> str:
    return CAPITAL_PACKAGE.sub(lambda match: match[1].lower() + "/", text)

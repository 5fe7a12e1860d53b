# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One ROS 1 bag as raw messages in CDR, by the package `rosbags`; damage becomes notes."""

from __future__ import annotations

import re
import struct
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.messages import BagFile, RawMessage

MAGIC = b"#ROSBAG"
_DAMAGE = (OSError, RuntimeError, ValueError, LookupError, AssertionError, EOFError, struct.error)
_CAPITAL_PACKAGE = re.compile(r"\b([A-Z]\w*)/")  # allowed in ROS 1, not in ROS 2, which rosbags follows


class Ros1File(BagFile):
    """See BagFile; with the types and the CDR of ROS 2.

    Raises RecordingError without the package rosbags, and for a file that is not a readable ROS 1 bag.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with _opened(path) as reader:
            from rosbags.typesys import Stores, get_typestore

            # The types of ROS 2, because their headers have no `seq`, which rosbags then leaves out.
            self._store = get_typestore(Stores.ROS2_HUMBLE)
            self.topics = {c.topic: self._registered(c) for c in reader.connections}
            self.schemas = {kind: self._definition(kind) for kind in self.topics.values()}

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """See BagFile."""
        from rosbags.rosbag1 import ReaderError
        from rosbags.serde import SerdeError

        read = undone = 0
        with _opened(self.path) as reader:
            wanted = [c for c in reader.connections if topics is None or c.topic in topics]
            messages = reader.messages(connections=wanted) if wanted else iter(())
            while True:
                try:
                    c, time, data = next(messages)
                except StopIteration:
                    break
                except (ReaderError, *_DAMAGE) as error:
                    self._lost(f"damaged after {read} messages ({error or type(error).__name__}); the rest is not read")
                    break
                read += 1
                kind = _lower_package(c.msgtype)
                try:
                    yield RawMessage(c.topic, kind, time, bytes(self._store.ros1_to_cdr(data, kind)))
                except (SerdeError, *_DAMAGE):
                    undone += 1
        if undone:
            self._lost(f"{undone} messages do not fit the definition of their type and were skipped")

    def _registered(self, connection: Any) -> str:
        """The type of a connection, known to the store from now on."""
        from rosbags.typesys import TypesysError, get_types_from_msg

        kind = _lower_package(connection.msgtype)
        if kind not in self._store.types:
            try:
                found = get_types_from_msg(_lower_package(connection.msgdef.data), kind)
                self._store.register({name: fields for name, fields in found.items() if name not in self._store.types})
            except (TypesysError, *_DAMAGE) as error:
                self._lost(f"{connection.topic}: the definition of {kind} cannot be read ({error})")
        return kind

    def _definition(self, kind: str) -> str:
        return str(self._store.generate_msgdef(kind, ros_version=2)[0]) if kind in self._store.types else ""


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """An open `rosbags` reader of a ROS 1 bag.

    Raises RecordingError without the package, and for a file that is missing or cannot be opened.
    """
    try:
        from rosbags.rosbag1 import Reader, ReaderError
    except ImportError:
        raise RecordingError(f"{path}: ROS 1 bags need the package rosbags (pip install rosbags)") from None
    if not path.is_file():
        raise RecordingError(f"{path}: is not a file, give a ROS 1 bag")
    try:
        reader = Reader(path)
        reader.open()
    except (ReaderError, *_DAMAGE) as error:
        raise RecordingError(f"{path}: the ROS 1 bag cannot be opened ({error})") from None
    try:
        yield reader
    finally:
        reader.close()


def _lower_package(text: str) -> str:
    """A type's name or definition with packages in lower case."""
    return _CAPITAL_PACKAGE.sub(lambda match: match[1].lower() + "/", text)

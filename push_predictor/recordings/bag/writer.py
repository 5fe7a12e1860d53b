# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Write a rosbag2 bag of any messages: under its name only when it is complete, or from the start (`live`)."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType

from mcap.writer import CompressionType, Writer

from push_predictor.errors import RecordingError
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.bag.metadata import METADATA_FILE, TopicInfo, bag_metadata_text, qos_text

COMPRESSIONS = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}
CHUNK_SIZE = 1 << 20
LIVE_CHUNK_SIZE = 1 << 15  # bytes: what a killed process loses at most, with what was written since the last flush()
LARGEST_STAMP = 2**63 - 1


class BagWriter:
    """A context manager that writes a bag.

    path: a folder (metadata.yaml and NAME_0.mcap, for `ros2 bag play`) or a bare NAME.mcap. An earlier bag of that name
    is replaced; after an exception inside the context it is unchanged. The same calls write the same bytes.

    live: for messages that cannot be had again. The file grows under its final name, an earlier bag is removed on
    entering, and the bag is completed after an exception as well. A killed process leaves a readable MCAP file.

    Raises RecordingError if path is not a bag or cannot be written, and for an unknown compression (zstd, lz4 and none
    are accepted).
    """

    def __init__(self, path: Path, *, compression: str = "zstd", live: bool = False) -> None:
        if compression not in COMPRESSIONS:
            raise RecordingError(f"compression: {compression!r}, give one of {', '.join(COMPRESSIONS)}")
        self.path = Path(os.path.abspath(path))
        self._bare = self.path.suffix == ".mcap"
        check_replaceable(self.path, bare=self._bare)
        self._live = live
        unfinished = self.path.with_name(f".{self.path.name}.{os.getpid()}.unfinished")
        self._unfinished = self.path if live else unfinished
        self._file_name = self.path.name if self._bare else f"{self.path.name}_0.mcap"
        self._compression = COMPRESSIONS[compression]
        self._topics: dict[str, TopicInfo] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._records: dict[str, Mapping[str, str]] = {}
        self._first, self._last = LARGEST_STAMP, 0

    def __enter__(self) -> BagWriter:
        try:
            with self._naming_the_bag():
                self._stream = self._create().open("wb")
        except RecordingError:
            if not self._live:
                with suppress(OSError):
                    _remove(self._unfinished)
            raise
        chunk_size = LIVE_CHUNK_SIZE if self._live else CHUNK_SIZE
        # The mcap library writes offsets of empty groups too, such as that of the attachments: readers report an error.
        offsets = {"use_summary_offsets": False}
        self._writer = Writer(self._stream, chunk_size=chunk_size, compression=self._compression, **offsets)
        self._writer.start(profile="ros2", library="push_predictor")  # a few bytes into the stream's buffer
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None or self._live:
                with self._naming_the_bag():
                    self._finish()
        finally:
            with suppress(OSError):  # closing retries the failed write, which has been reported
                self._stream.close()
            if not self._live:
                _remove(self._unfinished)

    def add_topic(
        self,
        name: str,
        type: str,
        schema_text: str,
        *,
        type_hash: str = "",
        depth: int = 10,
        durability: str = "volatile",
        reliability: str = "reliable",
    ) -> None:
        """Declare a topic (keep last). schema_text: ros2msg with all referenced definitions."""
        topic = TopicInfo(absolute(name), type, 0, type_hash, depth, durability, reliability)
        metadata = {"offered_qos_profiles": qos_text(topic), "topic_type_hash": type_hash}
        with self._naming_the_bag():
            if type not in self._schemas:
                self._schemas[type] = self._writer.register_schema(type, "ros2msg", schema_text.encode())
            self._channels[topic.name] = self._writer.register_channel(topic.name, "cdr", self._schemas[type], metadata)
        self._topics[topic.name] = topic

    def add_metadata(self, name: str, record: Mapping[str, str]) -> None:
        """Write an MCAP Metadata record, also to the metadata.yaml of a folder."""
        self._records[name] = dict(record)
        with self._naming_the_bag():
            self._writer.add_metadata(name, dict(record))

    def write(self, topic: str, stamp: int, data: bytes) -> None:
        """Write a CDR message with stamp (ns) as log and publish time.

        Raises RecordingError for a stamp out of range and for a full disk, KeyError for a topic that was not
        added.
        """
        name = absolute(topic)
        if not 0 <= stamp <= LARGEST_STAMP:
            raise RecordingError(f"{self.path}: {name} stamp {stamp}, give ns from 0 to {LARGEST_STAMP}")
        try:
            self._writer.add_message(self._channels[name], stamp, data, stamp)
        except OSError as error:
            raise self._unwritten(error) from None
        self._topics[name].count += 1
        self._first, self._last = min(self._first, stamp), max(self._last, stamp)

    def flush(self) -> None:
        """Hand all complete chunks to the operating system. Raises RecordingError for a full disk."""
        with self._naming_the_bag():
            self._stream.flush()

    @contextmanager
    def _naming_the_bag(self) -> Iterator[None]:
        """Raise an OSError as a RecordingError that names the bag."""
        try:
            yield
        except OSError as error:
            raise self._unwritten(error) from None

    def _unwritten(self, error: OSError) -> RecordingError:
        return RecordingError(f"{self.path}: cannot be written ({error.strerror})")

    def _create(self) -> Path:
        """Create the folder of the unfinished file; returns its path."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        _remove(self._unfinished)
        if self._bare:
            return self._unfinished
        self._unfinished.mkdir()
        return self._unfinished / self._file_name

    def _finish(self) -> None:
        self._writer.finish()
        self._stream.flush()
        os.fsync(self._stream.fileno())
        self._stream.close()
        if not self._bare:
            write_whole(self._unfinished / METADATA_FILE, self._metadata_text().encode())
        if self._live:
            return
        if self._bare:
            self._unfinished.replace(self.path)
        else:
            replace_folder(self.path, self._unfinished)

    def _metadata_text(self) -> str:
        start = min(self._first, self._last)
        return bag_metadata_text(self._file_name, start, self._last - start, self._topics.values(), self._records)


def absolute(topic: str) -> str:
    """The topic's name with a leading slash, as recorded by rosbag2."""
    return "/" + topic.lstrip("/")


def check_replaceable(path: Path, *, bare: bool = False) -> None:
    """Raise RecordingError unless a bag can be written there: a path that is free or has a bag, no other folder."""
    if bare and path.is_dir():
        raise RecordingError(f"{path}: is a folder, give a file name or a folder name without .mcap")
    if bare or not path.exists():
        return
    if not path.is_dir() or any(p.name != METADATA_FILE and p.suffix != ".mcap" for p in path.iterdir()):
        raise RecordingError(f"{path}: exists and is not a bag, give another name or remove it")


def replace_folder(path: Path, new: Path) -> None:
    """Replace an earlier folder by a new one; if that fails, the earlier one is restored."""
    earlier = new.with_suffix(".earlier")
    if path.is_dir():
        path.rename(earlier)
    try:
        new.replace(path)
    except OSError:
        if earlier.is_dir():
            earlier.rename(path)
        raise
    _remove(earlier)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)

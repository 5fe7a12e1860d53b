# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A bag: one file, or a folder of files as written by rosbag2. Raw CDR messages in file order."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.compression import unpack_file, unpack_message
from push_predictor.recordings.bag.csv_streams import CsvStreams, is_csv_recording
from push_predictor.recordings.bag.mcap_file import McapFile
from push_predictor.recordings.bag.messages import Messages, RawMessage, gathered
from push_predictor.recordings.bag.metadata import (
    METADATA_FILE,
    BagMetadata,
    embedded_records,
    read_bag_metadata,
)
from push_predictor.recordings.bag.ros1_file import MAGIC as ROS1
from push_predictor.recordings.bag.ros1_file import Ros1File
from push_predictor.recordings.bag.sqlite_file import MAGIC as SQLITE
from push_predictor.recordings.bag.sqlite_file import SqliteFile

__all__ = ["Bag", "RawMessage", "open_bag"]

BagFile = McapFile | SqliteFile | Ros1File | CsvStreams
ENDINGS = (".mcap", ".db3", ".bag")


class Bag:
    """The files of a bag as one.

    path: the opened file or folder; name: its stem. messages() reads the files in the bag's order; notes grow while
    messages are read.
    """

    def __init__(
        self,
        path: Path,
        files: list[BagFile],
        described: BagMetadata,
        scratch: tempfile.TemporaryDirectory[str] | None = None,
    ) -> None:
        self.path = path
        self.name = path.name if path.is_dir() else path.stem
        self.files = files
        self._described = described
        self._scratch = scratch  # contains decompressed files while the bag is in use

    @property
    def storage(self) -> str:
        """rosbag2's name of the format: mcap or sqlite3; empty for files that rosbag2 cannot read."""
        kinds = ((McapFile, "mcap"), (SqliteFile, "sqlite3"))
        return next((name for kind, name in kinds if isinstance(self.files[0], kind)), "")

    @property
    def topics(self) -> dict[str, str]:
        """{topic: type}, by topic name."""
        merged = {topic: kind for file in self.files[::-1] for topic, kind in file.topics.items()}
        return dict(sorted(merged.items()))

    @property
    def schemas(self) -> dict[str, str]:
        """{type: definition text}."""
        return {kind: text for file in self.files for kind, text in file.schemas.items()}

    @property
    def qos(self) -> dict[str, str]:
        """{topic: offered QoS profiles as rosbag2's YAML text, '' if unknown}."""
        return {topic: text for file in self.files for topic, text in file.qos.items()}

    @property
    def metadata(self) -> dict[str, Mapping[str, object]]:
        """{record name: {key: value}}: the records of the files, completed by the custom_data of rosbag2."""
        records = {name: record for file in self.files for name, record in file.metadata.items()}
        return {**embedded_records(records), **self._described.custom_data, **records}

    @property
    def notes(self) -> list[str]:
        """Sentences about the damage found so far."""
        own = [*self._described.notes, *(note for file in self.files for note in file.notes)]
        return own + [
            f"{self.path}: {name} in {METADATA_FILE} differs from the one in the .mcap file, which is used"
            for name, record in self._described.custom_data.items()
            if any(file.metadata.get(name, record) != record for file in self.files)
        ]

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """CDR messages in file order, of all topics or of the given ones; damage becomes a note."""
        for file in self.files:
            yield from file.messages(topics)

    def portions(self, topics: Collection[str]) -> Iterator[Messages]:
        """The messages of the given topics, those of a topic and type in file order; damage becomes a note."""
        for file in self.files:
            if isinstance(file, McapFile):
                yield from file.portions(topics)
            else:
                yield from gathered(file.messages(topics))


def open_bag(path: Path) -> Bag:
    """Open an MCAP, sqlite3 (.db3) or ROS 1 file, or a folder of them or of CSV or Parquet streams.

    The first bytes of a file decide which it is. Raises RecordingError without such files, or if all are empty or
    foreign; a single such file becomes a note.
    """
    path = Path(path)
    if not path.is_dir():
        return Bag(path, [_file(path)], BagMetadata())
    described = read_bag_metadata(path)
    if not (files := _listed(path, described) or _found(path)):
        if is_csv_recording(path):
            return Bag(path, [CsvStreams(path)], described)
        raise RecordingError(
            f"{path}: contains no .mcap file, no .db3 and no .bag, and not both slider.csv and pusher.csv"
        )
    scratch = tempfile.TemporaryDirectory(prefix="push_predictor_") if described.compression == "file" else None
    folder = None if scratch is None else Path(scratch.name)
    return Bag(path, _opened(files, described, folder), described, scratch)


def _opened(files: list[Path], described: BagMetadata, scratch: Path | None) -> list[BagFile]:
    """The readable files. Raises the error of the first file if none is readable."""
    opened: list[BagFile] = []
    refused: list[RecordingError] = []
    for file in files:
        try:
            opened.append(_open(file, described, scratch))
        except RecordingError as error:
            refused.append(error)
    if not opened:
        raise refused[0]
    described.notes.extend(f"{error}; the other files are used" for error in refused)
    return opened


def _open(file: Path, described: BagMetadata, scratch: Path | None) -> BagFile:
    if scratch is not None:
        unpacked = unpack_file(file, scratch, described.notes)
        return _file(unpacked, name=str(file) if unpacked == file else f"{file}, decompressed,")
    return _file(file, unpack=unpack_message if described.compression == "message" else bytes)


def _file(path: Path, *, unpack: Callable[[bytes | bytearray], bytes] = bytes, name: str = "") -> BagFile:
    """A file of the kind that its first bytes show."""
    try:
        with path.open("rb") as stream:
            start = stream.read(len(SQLITE))
    except OSError:
        start = b""  # McapFile states why
    if start.startswith(SQLITE):
        return SqliteFile(path, unpack=unpack, name=name)
    return Ros1File(path) if start.startswith(ROS1) else McapFile(path, unpack=unpack, name=name)


def _listed(folder: Path, described: BagMetadata) -> list[Path]:
    """The existing files named in metadata.yaml, in its order."""
    # Older bags have the folder's name before the file's.
    named = [folder / Path(name).name for name in described.files]
    absent = [file.name for file in named if not file.is_file()]
    described.notes.extend(f"{folder}: {name} is listed in {METADATA_FILE} but missing" for name in absent)
    return [file for file in named if file.is_file()]


def _found(folder: Path) -> list[Path]:
    """The files of the folder, bag_2 before bag_10; of several kinds, those of the first in ENDINGS."""
    kinds = ([*folder.glob(f"*{ending}")] for ending in ENDINGS)
    return sorted(next(filter(None, kinds), []), key=_numbered)


def _numbered(file: Path) -> list[tuple[str, int]]:
    return [(text, int(part or -1)) for text, part in re.findall(r"(\D*)(\d*)", file.name)]

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A bag: one file, or a folder of files as written by rosbag2. Raw CDR messages in file order."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.compression import ENDING, start_of, unpack_file
from push_predictor.recordings.bag.csv_streams import CsvStreams, is_csv_recording
from push_predictor.recordings.bag.mcap_file import MAGIC as MCAP
from push_predictor.recordings.bag.mcap_file import McapFile
from push_predictor.recordings.bag.messages import BagFile, Messages, Notes, RawMessage
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

ENDINGS = (".mcap", ".db3", ".bag")
MOST_GAPS = 20  # missing files that are named


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
        for topic, kind in self.topics.items():
            self.set_type(topic, kind)  # where another file has the schema

    @property
    def storage(self) -> str:
        """rosbag2's name of the format: mcap or sqlite3; empty for files that rosbag2 cannot read."""
        return self.files[0].storage

    @property
    def topics(self) -> dict[str, str]:
        """{topic: type}, by topic name."""
        merged: dict[str, str] = {}
        for file in self.files:
            for topic, kind in file.topics.items():
                merged[topic] = merged.get(topic) or kind
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
    def notes(self) -> Notes:
        """Sentences about the damage found so far."""
        found = Notes()
        for each in (self._described.notes, *(file.notes for file in self.files)):
            found.add_all(each)
        for name, record in self._described.custom_data.items():
            if any(file.metadata.get(name, record) != record for file in self.files):
                found.add(
                    f"{self.path}: {name} in {METADATA_FILE} differs from the one in the .mcap file, which is used"
                )
        return found

    def spelled(self, name: str) -> str:
        """The bag's own spelling of a topic's name, with a slash before it if there is no such topic."""
        return next((topic for topic in self.topics if topic.strip("/") == name.strip("/")), f"/{name.strip('/')}")

    def set_type(self, topic: str, kind: str) -> None:
        """State the type of a topic where its schema is missing."""
        for file in self.files:
            if file.topics.get(topic) == "":
                file.topics[topic] = kind

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """CDR messages in file order, of all topics or of the given ones; damage becomes a note."""
        for file in self.files:
            yield from file.messages(topics)

    def portions(self, topics: Collection[str]) -> Iterator[Messages]:
        """The same of the given topics, many of a topic and type at once."""
        for file in self.files:
            yield from file.portions(topics)


def open_bag(path: Path) -> Bag:
    """Open an MCAP, sqlite3 (.db3) or ROS 1 file, or a folder of them or of CSV streams.

    The first bytes of a file decide which it is, and whether it is compressed. Raises RecordingError without such
    files, or if all are empty or foreign; a single such file becomes a note.
    """
    path = Path(path)
    described = read_bag_metadata(path) if path.is_dir() else BagMetadata()
    if not (files := _files(path, described) if path.is_dir() else [path]):
        if is_csv_recording(path):
            return Bag(path, [CsvStreams(path)], described)
        files_needed = "no .mcap file, no .db3 and no .bag, and not both slider.csv and pusher.csv"
        raise RecordingError(f"{path}: contains {files_needed}{_sheets(path)}")
    packed = {file for file in files if file.suffix == ENDING or start_of(file)[1]}
    scratch = tempfile.TemporaryDirectory(prefix="push_predictor_") if packed else None
    folder = None if scratch is None else Path(scratch.name)
    return Bag(path, _opened(files, described, packed, folder), described, scratch)


def is_bag_file(path: Path) -> bool:
    """Whether a file is a recording, by its name or by its first bytes."""
    return _ending(path) in ENDINGS or _begins_as_bag(path)


def _sheets(folder: Path) -> str:
    """What to do with spreadsheets in a folder, '' without any."""
    found = sorted(file.name for file in folder.iterdir() if file.suffix.lower() in (".xlsx", ".xls", ".ods"))
    return f"; save the sheets of {found[0]} as these CSV files" if found else ""


def _opened(files: list[Path], described: BagMetadata, packed: set[Path], scratch: Path | None) -> list[BagFile]:
    """The readable files; those that are packed are decompressed into the scratch folder.

    Raises the error of the first file if none is readable.
    """
    opened: list[BagFile] = []
    refused: list[RecordingError] = []
    for file in files:
        try:
            if scratch is not None and file in packed:
                unpacked = unpack_file(file, scratch, described.notes)
                opened.append(_file(unpacked, name=f"{file}, decompressed,"))
            else:
                opened.append(_file(file))
        except RecordingError as error:
            refused.append(error)
    if not opened:
        raise refused[0]
    for reason in refused:
        described.notes.add(f"{reason}; the other files are used", lost=True)
    return opened


def _file(path: Path, *, name: str = "") -> BagFile:
    """A file of the kind that its first bytes show."""
    start, _ = start_of(path)
    if start.startswith(SQLITE):
        return SqliteFile(path, name=name)
    return Ros1File(path) if start.startswith(ROS1) else McapFile(path, name=name)


def _files(folder: Path, described: BagMetadata) -> list[Path]:
    """The files named in metadata.yaml, in its order; if none of them is there, those that are found."""
    # Older bags have the folder's name before the file's.
    named = [_packed_or_not(folder / Path(name).name) for name in described.files]
    files = [file for file in named if file.is_file()] or _found(folder)
    for file in named:
        if not file.is_file():
            absent = f"{folder}: {file.name} is listed in {METADATA_FILE} but missing"
            described.notes.add(absent, lost=len(files) < len(named))  # else all were renamed
    if len(files) >= len(named):
        for name in _gaps(folder, files):
            described.notes.add(f"{folder}: {name} is missing between the numbered files", lost=True)
    return files


def _gaps(folder: Path, files: list[Path]) -> list[str]:
    """The names that are missing if all files are the numbered parts of a recording, which rosbag2 counts from 0."""
    parts = [re.fullmatch(r"(.*_)(\d+)", file.name.partition(".")[0]) for file in files]
    found = [(part[1], int(part[2])) for part in parts if part]
    if len(found) < len(files) or len({name for name, _ in found}) != 1:
        return []
    (name, _), numbers = found[0], {number for _, number in found}
    first = 0 if name == f"{folder.name}_" else min(numbers)
    return [f"{name}{number}" for number in range(first, max(numbers)) if number not in numbers][:MOST_GAPS]


def _packed_or_not(file: Path) -> Path:
    """The file, or the same one compressed or decompressed since the list was written."""
    others = (file.with_name(f"{file.name}{ENDING}"), file.with_name(file.name.removesuffix(ENDING)))
    return next((each for each in (file, *others) if each.is_file()), file)


def _found(folder: Path) -> list[Path]:
    """The files of the folder, bag_2 before bag_10; of several kinds, those of the first in ENDINGS.

    Where no name ends so, those that begin as a bag. A compressed file next to its content is left out.
    """
    files = sorted((file for file in folder.iterdir() if file.is_file()), key=_numbered)
    names = {file.name for file in files}
    files = [f for f in files if f.suffix != ENDING or f.name.removesuffix(ENDING) not in names]
    kinds = ([file for file in files if _ending(file) == ending] for ending in ENDINGS)
    return next(filter(None, kinds), None) or [file for file in files if _begins_as_bag(file)]


def _ending(file: Path) -> str:
    """The suffix of a name, without that of compression."""
    return Path(file.name.removesuffix(ENDING)).suffix


def _begins_as_bag(file: Path) -> bool:
    return start_of(file)[0].startswith((MCAP, SQLITE, ROS1))


def _numbered(file: Path) -> list[tuple[str, int]]:
    return [(text, int(part or -1)) for text, part in re.findall(r"(\D*)(\d*)", file.name)]

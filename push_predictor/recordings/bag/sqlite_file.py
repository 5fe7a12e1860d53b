# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One sqlite3 file of rosbag2 (.db3) as raw messages in file order; damage becomes notes.

Python contains sqlite3, so that these bags need no further package.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator, Mapping
from contextlib import closing
from pathlib import Path

import zstandard

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.compression import as_cdr
from push_predictor.recordings.bag.messages import BagFile, RawMessage

MAGIC = b"SQLite format 3\0"
_DAMAGE = (sqlite3.Error, UnicodeDecodeError)  # the latter: of names in a damaged schema
_MESSAGES = "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id"


class SqliteFile(BagFile):
    """See BagFile. Raises RecordingError for a file that is not a bag of rosbag2."""

    storage = "sqlite3"

    def __init__(self, path: Path, name: str = "") -> None:
        super().__init__(path, name)
        self._channels: dict[int, tuple[str, str]] = {}
        try:
            with closing(self._opened()) as database:
                self._read_topics(database)
                self.schemas = self._read_definitions(database)
                self.metadata = self._read_metadata(database)
        except (*_DAMAGE, OSError) as error:
            raise RecordingError(f"{self.name}: is not a readable sqlite3 bag of rosbag2 ({error})") from None

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """See BagFile; in order of time."""
        wanted = {number: of for number, of in self._channels.items() if topics is None or of[0] in topics}
        read = undone = 0
        try:
            with closing(self._opened()) as database:
                for number, time, data in database.execute(_MESSAGES):
                    read += 1
                    if number not in wanted:
                        continue
                    if not (isinstance(data, bytes) and isinstance(time, int) and time >= 0):
                        undone += 1  # in a damaged file a cell may have any type
                        continue
                    try:
                        message = as_cdr(data)
                    except zstandard.ZstdError:
                        undone += 1
                    else:
                        yield RawMessage(*wanted[number], time, message)
        except _DAMAGE as error:
            self._lost(f"damaged after {read} messages ({error}); the rest is not read")
        if undone:
            self._lost(f"{undone} messages cannot be read or decompressed and were skipped")

    def _opened(self) -> sqlite3.Connection:
        # A recorder that was killed leaves a write-ahead log; without one nothing is written next to the bag.
        mode = "mode=ro" if self.path.with_name(f"{self.path.name}-wal").exists() else "mode=ro&immutable=1"
        database = sqlite3.connect(f"{self.path.absolute().as_uri()}?{mode}", uri=True)
        database.text_factory = lambda text: text.decode(errors="replace")
        return database

    def _read_topics(self, database: sqlite3.Connection) -> None:
        columns = {row[1] for row in database.execute("PRAGMA table_info(topics)")}
        qos = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
        for number, topic, kind, encoding, offered in database.execute(
            f"SELECT id, name, type, serialization_format, {qos} FROM topics ORDER BY id"
        ):
            if not (isinstance(topic, str) and isinstance(kind, str)):
                self._lost(f"the topic number {number} has no readable name or type; its messages were skipped")
                continue
            if encoding != "cdr":
                self._lost(f"{topic} is encoded as {encoding!r}, cdr is accepted; its messages were skipped")
                continue
            self._channels[number] = (topic, kind)
            self.topics[topic], self.qos[topic] = kind, offered or ""

    def _read_definitions(self, database: sqlite3.Connection) -> dict[str, str]:
        """{type: ros2msg text}; rosbag2 records them since ROS 2 Iron."""
        if not _has(database, "message_definitions"):
            return {}
        rows = database.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
        return {kind: text for kind, encoding, text in rows if encoding == "ros2msg" and isinstance(text, str)}

    def _read_metadata(self, database: sqlite3.Connection) -> dict[str, Mapping[str, str]]:
        """The copy of metadata.yaml that rosbag2 keeps in the file since ROS 2 Iron."""
        if not _has(database, "metadata"):
            return {}
        found = database.execute("SELECT metadata FROM metadata ORDER BY id DESC LIMIT 1").fetchone()
        return {"rosbag2": {"serialized_metadata": found[0]}} if found else {}


def _has(database: sqlite3.Connection, table: str) -> bool:
    return bool(database.execute("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?", (table,)).fetchone())

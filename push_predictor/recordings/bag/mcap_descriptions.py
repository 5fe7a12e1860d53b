# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The descriptions in an MCAP file: topics, types, definitions and metadata."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable

from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema

from push_predictor.recordings.bag.mcap_records import Bytes, parse

Wanted = dict[int, tuple[str, str]]  # channel id: topic and type


class Descriptions:
    """Collects the descriptions of a file.

    Of two different ones for a channel the first is used, with a note. topics: {topic: type}; schemas: {type:
    definition text}; qos: {topic: offered QoS as YAML text, '' if unknown}; metadata: {record name: {key: value}};
    channels: by id. note takes an offset and a description of the damage there.
    """

    def __init__(self, note: Callable[[int, str], None]) -> None:
        self.topics: dict[str, str] = {}
        self.schemas: dict[str, str] = {}
        self.qos: dict[str, str] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.channels: dict[int, Channel] = {}
        self._types: dict[int, str] = {}
        self._note = note

    def wanted(self, topics: Collection[str] | None, channels: Iterable[Channel]) -> Wanted:
        """The CDR channels among those given, of all topics or of the given ones."""
        return {
            channel.id: (channel.topic, self._types.get(channel.schema_id, ""))
            for channel in channels
            if channel.message_encoding == "cdr" and (topics is None or channel.topic in topics)
        }

    def register(self, opcode: int, content: Bytes, start: int, end: int, offset: int) -> Channel | None:
        """Store a record's description; returns the channel if it is one. Raises one of UNREADABLE."""
        if opcode == Opcode.SCHEMA:
            self.add_schema(parse(Schema, content, start, end))
        elif opcode == Opcode.CHANNEL:
            return self.add_channel(parse(Channel, content, start, end), offset)
        elif opcode == Opcode.METADATA:
            record = parse(Metadata, content, start, end)
            self.metadata[record.name] = record.metadata
        return None

    def add_schema(self, schema: Schema) -> None:
        """Store a type's name and definition."""
        self._types.setdefault(schema.id, schema.name)
        self.schemas.setdefault(schema.name, schema.data.decode(errors="replace"))

    def add_channel(self, channel: Channel, offset: int) -> Channel:
        """Store a channel; returns its first description."""
        known: Channel = self.channels.setdefault(channel.id, channel)
        if known != channel:
            self._note(offset, f"channel {channel.id} has a second, different description; the first one is used")
        self.topics.setdefault(known.topic, self._types.get(known.schema_id, ""))
        self.qos.setdefault(known.topic, known.metadata.get("offered_qos_profiles", ""))
        return known

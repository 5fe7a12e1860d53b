# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Bags in all forms, and damaged copies of them with known truth: which messages lie before the damage.

The mcap package alone writes the undamaged bags and reads the truth.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import lz4.frame
import zstandard
from mcap.opcode import Opcode
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, IndexType, Writer

POSE = "geometry_msgs/msg/PoseStamped"
START = 1_700_000_000_000_000_000
STEPS, CHUNK_SIZE = 300, 128_000
MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")

Message = tuple[str, int, bytes]  # topic, log time, CDR


@dataclass(frozen=True)
class Unit:
    """A record of the data section or of the summary, from its first byte to the next one's; its messages."""

    opcode: int
    start: int
    end: int
    messages: tuple[Message, ...]


@dataclass(frozen=True)
class Form:
    """An undamaged bag: the bytes of its file on disk, and as MCAP.

    checked: checksums show which messages are damaged. summed: a checksum shows at least that some are. packed: what
    rosbag2 compressed in addition, 'file', 'message' or ''. largest: bytes of its largest chunk, unpacked (without
    chunks, that of the other bags).
    """

    name: str
    disk: bytes
    mcap: bytes
    checked: bool
    summed: bool
    packed: str
    units: tuple[Unit, ...]
    messages: tuple[Message, ...]
    largest: int


@dataclass(frozen=True)
class Copy:
    """A damaged copy. must: number of messages before the damage; near: (from, to) bytes where a note must place it."""

    form: Form
    kind: str
    disk: bytes
    must: int
    near: tuple[int, int]


_OPTIONS: dict[str, dict[str, Any]] = {
    "zstd": {"compression": CompressionType.ZSTD},
    "lz4": {"compression": CompressionType.LZ4},
    "no compression": {"compression": CompressionType.NONE},
    "no checksums": {"compression": CompressionType.ZSTD, "enable_crcs": False},
    "no summary": {
        "index_types": IndexType.NONE,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_statistics": False,
        "use_summary_offsets": False,
    },
    "no chunks": {"use_chunking": False},
    "no chunks, checksum of all": {"use_chunking": False, "enable_data_crcs": True},
    "messages compressed": {"compression": CompressionType.NONE, "chunk_size": CHUNK_SIZE // 2},
    "file compressed": {"compression": CompressionType.NONE},
}


def forms() -> list[Form]:
    """The same recording in every form that is accepted."""
    return [_form(name, options) for name, options in _OPTIONS.items()]


def write_form(folder: Path, form: Form, disk: bytes) -> Path:
    """Write a bag, or a damaged copy, to disk; returns the path to open."""
    name = "bag_0.mcap.zstd" if form.packed == "file" else "bag_0.mcap"
    (folder / name).write_bytes(disk)
    if not form.packed:
        return folder / name
    described = f"relative_file_paths: [{name}], compression_mode: {form.packed}, compression_format: zstd"
    (folder / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information: {{version: 9, storage_identifier: mcap, {described}}}\n"
    )
    return folder


def damaged(form: Form, kind: str, random: Random) -> Copy:
    """One copy of a kind of KINDS."""
    data = form.mcap if kind in _OF_MCAP or form.packed != "file" else form.disk
    changed = KINDS[kind](form, bytearray(data), random)
    if form.packed == "file":
        return _of_packed_file(form, kind, changed, data is form.mcap)
    return _judged(form, kind, changed, changed)


def _of_packed_file(form: Form, kind: str, changed: bytes, is_mcap: bool) -> Copy:
    if is_mcap:
        return _judged(form, kind, zstandard.compress(changed), changed)
    if changed == form.disk:
        return Copy(form, kind, changed, len(form.messages), (0, 0))
    # Data 1 kB before the first damaged byte unpacks, as far as whole blocks go.
    first = max(0, _common(form.disk, changed) - 1024)
    prefix = zstandard.ZstdDecompressor().decompressobj().decompress(form.disk[:first])
    if form.disk.startswith(changed):
        return Copy(form, kind, changed, _judged(form, kind, b"", prefix).must if prefix else 0, (0, len(form.mcap)))
    must = sum(len(unit.messages) for unit in form.units if unit.end <= len(prefix))
    return Copy(form, kind, changed, must, (0, len(form.mcap)))


def _judged(form: Form, kind: str, disk: bytes, mcap: bytes) -> Copy:
    first = _common(form.mcap, mcap)
    hit = next((unit for unit in form.units if first < unit.end), form.units[-1])
    must = sum(len(unit.messages) for unit in form.units if unit.end <= first)
    if first == len(mcap) < hit.end and hit.opcode == Opcode.CHUNK:
        must += _before_cut(form.mcap, hit, first)
    last = len(form.mcap) - _common(form.mcap[::-1], mcap[::-1])
    until = next((unit.end for unit in form.units if max(first, last - 1) < unit.end), len(form.mcap))
    if not form.checked and (form.summed or kind == "a chunk missing"):
        until = len(form.mcap)  # the checksum at the end shows only that something is wrong
    return Copy(form, kind, disk, 0 if first < len(MAGIC) else must, (min(hit.start, len(mcap)), until))


def _before_cut(data: bytes, unit: Unit, cut: int) -> int:
    """Complete messages of a chunk before a cut, as far as the bytes there unpack."""
    (length,) = struct.unpack_from("<I", data, unit.start + 37)
    begin = unit.start + 41 + length + 8
    if cut <= begin:
        return 0
    name, packed = data[unit.start + 41 : begin - 8].decode(), data[begin:cut]
    if name == "zstd":
        content = zstandard.ZstdDecompressor().decompressobj().decompress(packed)
    elif name == "lz4":
        content = lz4.frame.LZ4FrameDecompressor().decompress(packed)
    else:
        content = packed
    position = count = 0
    while position + 9 <= len(content):
        opcode, length = _HEAD.unpack_from(content, position)
        position += 9 + length
        count += opcode == Opcode.MESSAGE and position <= len(content)
    return count


# Kinds of damage: (form, bytes, random) -> bytes


def _cut(form: Form, data: bytearray, random: Random) -> bytes:
    return bytes(data[: random.randrange(len(data))])


def _bit(form: Form, data: bytearray, random: Random) -> bytes:
    data[random.randrange(len(data))] ^= 1 << random.randrange(8)
    return bytes(data)


def _bits(form: Form, data: bytearray, random: Random) -> bytes:
    for _ in range(random.randint(2, 20)):
        _bit(form, data, random)
    return bytes(data)


def _head_bit(form: Form, data: bytearray, random: Random) -> bytes:
    """A bit in the head of a record: its opcode, its length, a chunk's own lengths."""
    place = random.choice(form.units).start + random.randrange(54)
    data[min(place, len(data) - 1)] ^= 1 << random.randrange(8)
    return bytes(data)


def _overwritten(form: Form, data: bytearray, random: Random) -> bytes:
    start = random.randrange(len(data))
    end = min(len(data), start + random.randint(1, 4000))
    data[start:end] = random.randbytes(end - start)
    return bytes(data)


def _zeroed(form: Form, data: bytearray, random: Random) -> bytes:
    """A hole in the file, or zeros to its end."""
    start = random.randrange(len(data))
    end = random.choice([len(data), min(len(data), start + random.randint(1, 100_000))])
    data[start:end] = bytes(end - start)
    return bytes(data)


def _lost(form: Form, data: bytearray, random: Random) -> bytes:
    start = random.randrange(len(data))
    del data[start : start + random.randint(1, 20_000)]
    return bytes(data)


def _gained(form: Form, data: bytearray, random: Random) -> bytes:
    start = random.randrange(len(data))
    data[start:start] = random.randbytes(random.randint(1, 2000))
    return bytes(data)


def _missing_chunk(form: Form, data: bytearray, random: Random) -> bytes:
    unit = random.choice(_large(form))
    del data[unit.start : unit.end]
    return bytes(data)


def _no_summary(form: Form, data: bytearray, random: Random) -> bytes:
    """Cut at the end of the data, or remove the summary."""
    end = next(unit for unit in form.units if unit.opcode == Opcode.DATA_END).end
    footer = struct.pack("<BQQQI", Opcode.FOOTER, 20, 0, 0, 0) + MAGIC
    return bytes(data[:end]) + random.choice([b"", footer])


def _wrong_checksum(form: Form, data: bytearray, random: Random) -> bytes:
    """Overwrite the checksum of a chunk; without chunks, of the data or of the summary."""
    chunks = [unit for unit in form.units if unit.opcode == Opcode.CHUNK]
    end = next(unit for unit in form.units if unit.opcode == Opcode.DATA_END)
    places = [unit.start + 33 for unit in chunks] or [end.start + 9]
    place = random.choice([*places, len(data) - 12])
    data[place : place + 4] = random.randbytes(4)
    return bytes(data)


def _wrong_length(form: Form, data: bytearray, random: Random) -> bytes:
    """Write a wrong length into the head of a record, or into a chunk's own fields."""
    unit = random.choice(_large(form))
    fields = (
        [1] if unit.opcode != Opcode.CHUNK else [1, 25, 37, 41 + struct.unpack_from("<I", data, unit.start + 37)[0]]
    )
    place = unit.start + random.choice(fields)
    wide = place != unit.start + 37
    lies = [0, 1, 1 << 16, len(data), 1 << 30, 1 << 31, (1 << 32) - 1, 1 << 40, 1 << 63, (1 << 64) - 1]
    stated = struct.unpack_from("<Q" if wide else "<I", data, place)[0]
    lie = random.choice([*lies, stated + 1, stated - 1, 2 * stated, stated + random.randrange(len(data))])
    struct.pack_into("<Q" if wide else "<I", data, place, lie & ((1 << 64) - 1 if wide else (1 << 32) - 1))
    return bytes(data)


def _bomb(form: Form, data: bytearray, random: Random) -> bytes:
    """Replace a chunk's records by 64 MB of zeros, compressed; its stated size stays."""
    unit = random.choice(_large(form))
    if unit.opcode != Opcode.CHUNK:
        return _wrong_length(form, data, random)
    packed, name = random.choice([(_ZSTD_BOMB, b"zstd"), (_LZ4_BOMB, b"lz4")])
    content = bytes(data[unit.start + 9 : unit.start + 37]) + struct.pack("<I", len(name)) + name
    content += struct.pack("<Q", len(packed)) + packed
    data[unit.start : unit.end] = _HEAD.pack(Opcode.CHUNK, len(content)) + content
    return bytes(data)


def _wrong_summary(form: Form, data: bytearray, random: Random) -> bytes:
    """Make an offset of the footer or of an index wrong, with a correct checksum."""
    start, _, crc = struct.unpack_from("<QQI", data, len(data) - 28)
    places = [unit.start + at for unit in form.units for at in _OFFSETS.get(unit.opcode, ()) if unit.start >= start > 0]
    place = random.choice([*places, len(data) - 28])
    inside = random.choice(form.units).start
    lie = random.choice([0, inside, inside + 5, random.randrange(len(data)), len(data), 1 << 40, (1 << 64) - 1])
    struct.pack_into("<Q", data, place, lie)
    if crc and start:
        struct.pack_into("<I", data, len(data) - 12, zlib.crc32(data[start:-12]))
    return bytes(data)


def _replaced(form: Form, data: bytearray, random: Random) -> bytes:
    """Replace the file by another one, or by nothing."""
    table = b"velocity,contact\n1,2\n"
    return random.choice([b"", table, MAGIC, random.randbytes(5000), MAGIC + random.randbytes(5000), bytes(5000)])


KINDS: dict[str, Callable[[Form, bytearray, Random], bytes]] = {
    "cut at any byte": _cut,
    "a bit": _bit,
    "2 to 20 bits": _bits,
    "a bit in a record's head": _head_bit,
    "overwritten": _overwritten,
    "zeroed": _zeroed,
    "bytes lost": _lost,
    "bytes gained": _gained,
    "a chunk missing": _missing_chunk,
    "no summary": _no_summary,
    "a checksum wrong": _wrong_checksum,
    "a wrong length": _wrong_length,
    "unpacks to 64 MB": _bomb,
    "a wrong summary": _wrong_summary,
    "another file, or empty": _replaced,
}
_OF_MCAP = set(KINDS) - {"cut at any byte", "a bit", "2 to 20 bits", "overwritten", "zeroed", "bytes lost"}
_OFFSETS = {Opcode.CHUNK_INDEX: (9 + 16,), Opcode.METADATA_INDEX: (9, 17)}
_ZSTD_BOMB = zstandard.compress(bytes(1 << 26))
_LZ4_BOMB = lz4.frame.compress(bytes(1 << 26))


def _large(form: Form) -> list[Unit]:
    """The units with messages."""
    return [unit for unit in form.units if unit.messages]


# The whole bags


def _form(name: str, options: dict[str, Any]) -> Form:
    packed = name.split()[0].removesuffix("s") if name.endswith("compressed") else ""
    mcap = _written({"chunk_size": CHUNK_SIZE, **options}, packed == "message")
    disk = zstandard.compress(mcap) if packed == "file" else mcap
    units = tuple(_units(mcap, packed == "message"))
    messages = tuple(message for unit in units for message in unit.messages)
    checked = "chunks" not in name and name != "no checksums"
    largest = max(max(CHUNK_SIZE, unit.end - unit.start) for unit in units)
    summed = checked or "checksum of all" in name
    return Form(name, disk, mcap, checked, summed, packed, units, messages, largest)


def _written(options: dict[str, Any], pack: bool) -> bytes:
    from io import BytesIO

    random, stream = Random(1), BytesIO()
    writer = Writer(stream, **options)
    writer.start(profile="ros2")
    pose = writer.register_schema(POSE, "ros2msg", b"# a pose")
    text = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
    channels = {t: writer.register_channel(t, "cdr", pose) for t in ("/slider/pose", "/pusher/pose")}
    channels["/camera"] = writer.register_channel("/camera", "cdr", text)
    writer.add_metadata("note", {"who": "made up"})
    for step in range(STEPS):
        for topic, channel in channels.items():
            time = START + 4_000_000 * step
            data = random.randbytes(1200) if topic == "/camera" else _pose(time, random)
            writer.add_message(channel, time, zstandard.compress(data) if pack else data, time)
    writer.add_metadata("more", {"what": "at the end"})
    writer.finish()
    return stream.getvalue()


def _pose(time: int, random: Random) -> bytes:
    head = struct.pack("<iII", *divmod(time, 10**9), 6) + b"world\0"
    numbers = struct.pack("<7d", random.random(), random.random(), 0.0, 0.0, 0.0, 0.0, 1.0)
    return b"\0\1\0\0" + head + b"\0" * (-len(head) % 8) + numbers


def _units(mcap: bytes, packed: bool) -> list[Unit]:
    from io import BytesIO

    topics: dict[int, str] = {}
    records = StreamReader(BytesIO(mcap), emit_chunks=True).records
    units, start = [], len(MAGIC)
    for record in records:
        opcode, length = _HEAD.unpack_from(mcap, start)
        end = start + _HEAD.size + length
        inside = breakup_chunk(record) if opcode == Opcode.CHUNK else [record]
        topics |= {r.id: r.topic for r in inside if type(r).__name__ == "Channel"}
        messages = [r for r in inside if type(r).__name__ == "Message"]
        unpacked = zstandard.decompress if packed else bytes
        units.append(
            Unit(opcode, start, end, tuple((topics[m.channel_id], m.log_time, unpacked(m.data)) for m in messages))
        )
        start = end
    return units


def _common(one: bytes, other: bytes) -> int:
    """The number of bytes at the start that are the same."""
    low, high = 0, min(len(one), len(other))
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if one[:middle] == other[:middle] else (low, middle - 1)
    return low

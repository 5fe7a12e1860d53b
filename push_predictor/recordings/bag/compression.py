# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Decompression of the files or messages that rosbag2 compresses with zstd in addition to MCAP."""

from __future__ import annotations

import shutil
from pathlib import Path

import zstandard

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.messages import Notes

ENDING = ".zstd"
FRAME = b"\x28\xb5\x2f\xfd"  # the first bytes of a zstd frame
LARGEST_MESSAGE = 1 << 28  # bytes; a foreign bag must not exhaust the memory
_START = 16  # bytes; enough for the first bytes of each kind of recording
_AT_ONCE = 1 << 20  # bytes; a message that claims more is decompressed in pieces
_PIECE, _COMPRESSED_PIECE = 1 << 15, 1 << 10  # bytes; small, because data before damage in the same piece are lost


def start_of(file: Path) -> tuple[bytes, bool]:
    """The first bytes of a file, none if they cannot be read, and whether they are those of a compressed content."""
    found, compressed = b"", False
    try:
        with file.open("rb") as stream:
            found = stream.read(_START)
            if compressed := found.startswith(FRAME):
                stream.seek(0)
                found = zstandard.ZstdDecompressor().stream_reader(stream).read(_START)
    except (OSError, zstandard.ZstdError):
        return b"", compressed
    return found, compressed


def unpack_file(file: Path, folder: Path, notes: Notes) -> Path:
    """A file in the folder, decompressed from a compressed one.

    A damaged file is decompressed up to the damage, with a note. The result uses at most half of the free disk space.
    Raises RecordingError if nothing can be decompressed.
    """
    target = folder / file.name
    try:
        _unpack(file, target, notes)
    except OSError as error:
        raise RecordingError(f"{file}: cannot be decompressed ({error})") from None
    if not target.stat().st_size:
        raise RecordingError(f"{file}: cannot be decompressed ({notes[-1] if notes else 'it is empty'})")
    return target


def as_cdr(data: bytes | bytearray) -> bytes:
    """A recorded message, decompressed if it is a zstd frame: CDR never begins as one.

    Raises zstandard.ZstdError for a damaged frame or a message that is too large.
    """
    if data[: len(FRAME)] != FRAME:
        return bytes(data)
    size = zstandard.frame_content_size(data)
    if not 0 <= size <= LARGEST_MESSAGE:
        raise zstandard.ZstdError(f"a message without a size, or larger than {LARGEST_MESSAGE} bytes")
    if size <= _AT_ONCE:
        return bytes(zstandard.ZstdDecompressor().decompress(data))
    reader, found = zstandard.ZstdDecompressor().stream_reader(data), bytearray()
    while len(found) <= size and (piece := reader.read(_PIECE)):
        found += piece
    if len(found) != size:
        raise zstandard.ZstdError(f"a message does not contain the {size} bytes that it claims")
    return bytes(found)


def _unpack(file: Path, target: Path, notes: Notes) -> None:
    allowed = shutil.disk_usage(target.parent).free // 2
    with file.open("rb") as packed, target.open("wb") as unpacked:
        reader = zstandard.ZstdDecompressor().stream_reader(packed, _COMPRESSED_PIECE, read_across_frames=True)
        try:
            while piece := reader.read1(_PIECE):
                if unpacked.tell() + len(piece) > allowed:
                    raise zstandard.ZstdError(f"it needs more than {allowed} bytes, half of the free disk space")
                unpacked.write(piece)
        except zstandard.ZstdError as error:
            notes.add(f"{file} at byte {packed.tell()}, or just before: cannot be decompressed ({error})", lost=True)

"""What rosbag2 may compress on top of MCAP: whole files or single messages, with zstd."""

from __future__ import annotations

import shutil
from pathlib import Path

import zstandard

from push_predictor.errors import RecordingError

ENDING = ".zstd"
LARGEST_MESSAGE = 1 << 28  # bytes: a bag from outside must not fill the memory
_BELIEVED = 1 << 20  # bytes: a message that tells of more is unpacked piece by piece
_PIECE, _PACKED_PIECE = 1 << 15, 1 << 10  # small: what stands before damage in one piece with it is lost


def unpack_file(file: Path, folder: Path, notes: list[str]) -> Path:
    """NAME.mcap in the folder, unpacked from NAME.mcap.zstd; a file of another ending is used as it is.

    Of a damaged one, what stands before the damage, and a note; it takes at most half of the disk that is free.
    Raises RecordingError if nothing can be unpacked.
    """
    if file.suffix != ENDING:
        return file
    target = folder / file.stem
    try:
        _unpack(file, target, notes)
    except OSError as error:
        raise RecordingError(f"{file}: cannot be unpacked ({error})") from None
    if not target.stat().st_size:
        raise RecordingError(f"{file}: cannot be unpacked ({notes.pop() if notes else 'it is empty'})")
    return target


def unpack_message(data: bytes) -> bytes:
    """The message in a zstd frame. Raises zstandard.ZstdError if there is none or it is too large."""
    size = zstandard.frame_content_size(data)
    if not 0 <= size <= LARGEST_MESSAGE:
        raise zstandard.ZstdError(f"a message without a size, or larger than {LARGEST_MESSAGE} bytes")
    if size <= _BELIEVED:
        return bytes(zstandard.ZstdDecompressor().decompress(data))
    reader, found = zstandard.ZstdDecompressor().stream_reader(data), bytearray()
    while len(found) <= size and (piece := reader.read(_PIECE)):
        found += piece
    if len(found) != size:
        raise zstandard.ZstdError(f"a message does not hold the {size} bytes it tells of")
    return bytes(found)


def _unpack(file: Path, target: Path, notes: list[str]) -> None:
    allowed = shutil.disk_usage(target.parent).free // 2
    with file.open("rb") as packed, target.open("wb") as unpacked:
        reader = zstandard.ZstdDecompressor().stream_reader(packed, _PACKED_PIECE, read_across_frames=True)
        try:
            while piece := reader.read1(_PIECE):
                if unpacked.tell() + len(piece) > allowed:
                    raise zstandard.ZstdError(f"it unpacks to more than {allowed} bytes, half of what is free")
                unpacked.write(piece)
        except zstandard.ZstdError as error:
            notes.append(f"{file} at byte {packed.tell()}, or just before: cannot be unpacked ({error})")

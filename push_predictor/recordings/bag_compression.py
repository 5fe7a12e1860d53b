"""What rosbag2 may compress on top of MCAP: whole files or single messages, with zstd."""

from __future__ import annotations

from pathlib import Path

import zstandard

from push_predictor.errors import RecordingError

ENDING = ".zstd"
LARGEST_MESSAGE = 1 << 28  # bytes: a bag from outside must not fill the memory


def unpack_file(file: Path, folder: Path) -> Path:
    """NAME.mcap in the folder, unpacked from NAME.mcap.zstd; a file of another ending is used as it is.

    Raises RecordingError if it cannot be unpacked.
    """
    if file.suffix != ENDING:
        return file
    target = folder / file.stem
    try:
        with file.open("rb") as packed, target.open("wb") as unpacked:
            zstandard.ZstdDecompressor().copy_stream(packed, unpacked)
    except (OSError, zstandard.ZstdError) as error:
        raise RecordingError(f"{file}: cannot be unpacked ({error})") from None
    return target


def unpack_message(data: bytes) -> bytes:
    """The message in a zstd frame. Raises zstandard.ZstdError if there is none or it is too large."""
    if not 0 <= zstandard.frame_content_size(data) <= LARGEST_MESSAGE:
        raise zstandard.ZstdError(f"a message without a size, or larger than {LARGEST_MESSAGE} bytes")
    return bytes(zstandard.ZstdDecompressor().decompress(data))

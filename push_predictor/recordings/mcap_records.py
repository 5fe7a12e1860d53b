"""The bytes of MCAP (https://mcap.dev/spec): records, chunks, the summary at a file's end. No file is opened.

Little-endian records of one byte opcode, eight bytes length, content; a chunk holds compressed records.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import Protocol, TypeVar

import lz4.frame  # type: ignore[import-untyped]  # ships no types
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")
MESSAGE = struct.Struct("<HIQQ")
LARGEST_CHUNK = 1 << 30  # bytes uncompressed: a file from outside must not fill the memory
UNREADABLE = (struct.error, UnicodeDecodeError, EndOfFile, zstandard.ZstdError, RuntimeError, ValueError)
_CHUNK = struct.Struct("<QQQII")
_FOOTER = struct.Struct("<QQI")
FOOTER_SIZE = HEAD.size + _FOOTER.size + len(MAGIC)

Record = TypeVar("Record", covariant=True)


class _Readable(Protocol[Record]):
    def read(self, stream: ReadDataStream, /) -> Record: ...


def parse(kind: _Readable[Record], data: bytes, start: int, end: int) -> Record:
    """One record's content as the mcap package's class. Raises one of UNREADABLE."""
    return kind.read(ReadDataStream(BytesIO(data[start:end])))


def split(data: bytes) -> Iterator[tuple[int, int, int]]:
    """(opcode, start, end) of each whole record in data; an incomplete last one is left out."""
    position, size = 0, len(data)
    while position + HEAD.size <= size:
        opcode, length = HEAD.unpack_from(data, position)
        position += HEAD.size
        if position + length > size:
            return
        yield opcode, position, position + length
        position += length


def unpack_chunk(body: bytes, whole: bool) -> bytes:
    """The records in a chunk; of a chunk cut off by the file's end (not whole), as many bytes as can be had.

    Raises one of UNREADABLE for an unknown compression, a wrong size or a wrong checksum.
    """
    _, _, size, crc, name_length = _CHUNK.unpack_from(body)
    name_end = _CHUNK.size + name_length
    name = body[_CHUNK.size : name_end].decode()
    if size > LARGEST_CHUNK:
        raise ValueError(f"a chunk of {size} bytes, {LARGEST_CHUNK} are accepted")
    data = _decompressed(name, body[name_end + 8 :], size)
    if whole and len(data) != size:
        raise ValueError(f"a chunk holds {len(data)} bytes instead of {size}")
    if whole and crc and zlib.crc32(data) != crc:
        raise ValueError("a chunk's checksum is wrong")
    return data


def summary_start(tail: bytes) -> int:
    """Where the summary section starts, from the file's last FOOTER_SIZE bytes; 0 where there is none."""
    if len(tail) != FOOTER_SIZE or not tail.endswith(MAGIC) or HEAD.unpack_from(tail) != (2, _FOOTER.size):
        return 0
    start, _, _ = _FOOTER.unpack_from(tail, HEAD.size)
    return int(start)


def _decompressed(name: str, data: bytes, size: int) -> bytes:
    if name == "":
        return data
    if name == "zstd":
        return bytes(zstandard.ZstdDecompressor().stream_reader(data, read_across_frames=True).read(size))
    if name == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size))
    raise ValueError(f"chunk compression {name!r}, zstd, lz4 and none are accepted")

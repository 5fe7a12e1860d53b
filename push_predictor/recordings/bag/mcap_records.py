# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The byte format of MCAP (https://mcap.dev/spec): records, chunks, compression. No file is opened.

Little-endian records of one byte opcode, eight bytes length, content; a chunk holds compressed records.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import BinaryIO, Final, NamedTuple, Protocol, TypeAlias, TypeVar

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")
MESSAGE = struct.Struct("<HIQQ")
LARGEST_CHUNK: Final = 1 << 30  # bytes uncompressed; a foreign file must not exhaust the memory
UNREADABLE = (struct.error, UnicodeDecodeError, EndOfFile, zstandard.ZstdError, RuntimeError, ValueError)
_ALL = frozenset(Opcode)
_CHUNK = struct.Struct("<QQQII")
_LENGTH = struct.Struct("<Q")
_PIECE: Final = 1 << 15
_LARGEST_NAME = 32

Bytes: TypeAlias = bytes | bytearray
Record = TypeVar("Record", covariant=True)


class _Readable(Protocol[Record]):
    def read(self, stream: ReadDataStream, /) -> Record: ...


class _Record(BytesIO):
    """A record's content; a string or number that is longer than its record is an error, not a short read."""

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        if size is not None and len(data) < size:
            raise EndOfFile
        return data


class ChunkHead(NamedTuple):
    """The fields before a chunk's records.

    begin: offset of the compressed records; packed: their number of bytes.
    """

    size: int
    crc: int
    compression: str
    begin: int
    packed: int


CHUNK_HEAD_SIZE = _CHUNK.size + _LARGEST_NAME + _LENGTH.size


def parse(kind: _Readable[Record], data: Bytes, start: int, end: int) -> Record:
    """One record's content as the mcap package's class. Raises one of UNREADABLE."""
    return kind.read(ReadDataStream(_Record(data[start:end])))


def split(data: Bytes, whole: bool = True) -> Iterator[tuple[int, int, int]]:
    """(opcode, start, end) of each record in data. Raises ValueError for invalid records.

    An incomplete last record is accepted only if data are not `whole`.
    """
    position, size = 0, len(data)
    while position + HEAD.size <= size:
        opcode, length = HEAD.unpack_from(data, position)
        begin = position + HEAD.size
        if opcode == 0 or begin + length > size:
            break
        yield opcode, begin, begin + length
        position = begin + length
    if whole and position != size:
        raise ValueError(f"the last whole record of a chunk ends at byte {position} of {size}")


def is_head(head: bytes) -> bool:
    """Whether these bytes can begin a record.

    Random bytes hardly ever do; a head cut by the end of the file does.
    """
    if len(head) < HEAD.size:
        return True
    opcode, length = HEAD.unpack(head)
    return bool((opcode in _ALL or opcode >= 0x80) and length < 4 * LARGEST_CHUNK)


def chunk_head(start: bytes, length: int) -> ChunkHead:
    """Read a chunk's first CHUNK_HEAD_SIZE bytes; length is that of the record.

    Raises one of UNREADABLE if its lengths contradict each other or are more than is accepted.
    """
    _, _, size, crc, name_length = _CHUNK.unpack_from(start)
    if name_length > _LARGEST_NAME:
        raise ValueError("a chunk without a known compression")
    begin = _CHUNK.size + name_length + _LENGTH.size
    (packed,) = _LENGTH.unpack_from(start, begin - _LENGTH.size)
    if begin + packed != length:
        raise ValueError(f"a chunk of {length} bytes claims {packed} bytes of records")
    if size > LARGEST_CHUNK:
        raise ValueError(f"a chunk of {size} bytes, {LARGEST_CHUNK} are accepted")
    if packed > size + size // 64 + 4096:
        raise ValueError(f"a chunk of {size} bytes claims {packed} compressed bytes")
    return ChunkHead(size, crc, start[_CHUNK.size : begin - _LENGTH.size].decode(), begin, packed)


def unpack_chunk(head: ChunkHead, stream: BinaryIO) -> Bytes:
    """Decompress the records of a chunk, which come next in the stream.

    Of a chunk that is cut off, the first ones. Memory is limited to the compressed bytes and the size that the head
    states. Raises one of UNREADABLE for an unknown compression, a wrong size or a wrong checksum.
    """
    packed = _Packed(stream, head.packed)
    found = _unpacked(head, packed)
    if len(found) > head.size or not (packed.cut or len(found) == head.size):
        raise ValueError(f"a chunk does not contain the {head.size} bytes that it claims")
    if packed.cut:
        return found
    if head.crc and zlib.crc32(found) != head.crc:
        raise ValueError("a chunk's checksum is wrong")
    return found


class _Packed:
    """The compressed records of a chunk, read on demand. cut: they ended too early."""

    def __init__(self, stream: BinaryIO, size: int) -> None:
        self._stream, self._left = stream, size
        self.cut = False

    def read(self, size: int) -> bytes:
        """At most `size` of the next bytes; none at the end."""
        wanted = min(size, self._left)
        data = self._stream.read(wanted)
        self._left -= len(data)
        self.cut = self.cut or len(data) < wanted
        return data


def _unpacked(head: ChunkHead, packed: _Packed) -> Bytes:
    """The decompressed bytes, at most one piece more than the head states."""
    if head.compression == "":
        return packed.read(head.packed)
    if head.compression not in ("zstd", "lz4"):
        raise ValueError(f"chunk compression {head.compression!r}, zstd, lz4 and none are accepted")
    if head.compression == "lz4":  # in pieces: incompressible data would take almost twice the memory
        return _gathered(_lz4_pieces(packed), head.size)
    # At once if the frame states the same size: libzstd's streaming decoder takes a window of twice a chunk.
    data = packed.read(head.packed)
    if data and not packed.cut and zstandard.frame_content_size(data) == head.size:
        return bytes(zstandard.ZstdDecompressor().decompress(data))
    return _gathered(_zstd_pieces(data), head.size)


def _gathered(pieces: Iterator[bytes], size: int) -> bytearray:
    found = bytearray()
    for piece in pieces:
        found += piece
        if len(found) > size:
            break
    return found


def _zstd_pieces(data: bytes) -> Iterator[bytes]:
    reader = zstandard.ZstdDecompressor().stream_reader(data, read_across_frames=True)
    while piece := reader.read(_PIECE):
        yield piece


def _lz4_pieces(packed: _Packed) -> Iterator[bytes]:
    reader = lz4.frame.LZ4FrameDecompressor()
    while not reader.eof and (data := packed.read(_PIECE)):
        yield reader.decompress(data, max_length=_PIECE)
        while not (reader.needs_input or reader.eof):
            yield reader.decompress(b"", max_length=_PIECE)

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Zip archives of a JSON record and numpy arrays: reading one of unknown origin takes little memory, runs no code."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from push_predictor.errors import ModelFileError

LARGEST = 1 << 30  # bytes unpacked; a model of 20 000 windows needs a hundredth of it
HEADER = "header"  # the first member: the record
ENDING = ".npy"
END = b"PK\x05\x06" + bytes(4)  # of an archive: how its last record begins
END_SIZE = 22  # bytes of that record


def archived(record: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> bytes:
    """The archive of a record and of arrays by name."""
    buffer, text = io.BytesIO(), np.frombuffer(json.dumps(record).encode(), dtype=np.uint8)
    np.savez_compressed(buffer, allow_pickle=False, **{HEADER: text}, **arrays)
    return buffer.getvalue()


def read_archive(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The record and the arrays. Raises ModelFileError for anything but an archive of complete arrays and a record.

    The file is read once, so that a file that is being replaced is read as the old or the new one.
    """
    try:
        if path.exists() and not path.is_file():
            raise ModelFileError(f"{path}: a folder, pipe or device is not accepted, give a model file")
        if (size := path.stat().st_size) > LARGEST:
            raise ModelFileError(f"{path}: has {size} bytes, at most {LARGEST} are accepted")
        data = path.read_bytes()
        if not data[-END_SIZE:].startswith(END):  # zipfile reads an archive with the rest of another file after it
            raise ValueError("it does not end with the record that ends an archive")
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
            if unpacked > LARGEST:
                raise ModelFileError(f"{path}: unpacks to {unpacked} bytes, at most {LARGEST} are accepted")
            arrays = {entry.filename.removesuffix(ENDING): _array(archive, entry) for entry in archive.infolist()}
    except ModelFileError:
        raise
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be read ({error.strerror or error})") from None
    except Exception as error:  # zip, its compressions and the headers of arrays raise a dozen different classes
        raise ModelFileError(f"{path}: not a model file, or a damaged one ({error})") from None
    try:
        return dict(json.loads(arrays.pop(HEADER).tobytes().decode())), arrays
    except (KeyError, TypeError, ValueError, RecursionError):
        raise ModelFileError(f"{path}: contains no header of a push_predictor model") from None


def _array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> np.ndarray:
    """One member, read to its end even if its header declares a shorter array: only then is the checksum verified."""
    with archive.open(entry) as member:
        data = member.read(entry.file_size)  # no more, whatever it would unpack to
    stream = io.BytesIO(data)
    if npy.read_magic(stream) != (1, 0):
        raise ValueError(f"{entry.filename} is not an array of version 1.0")
    shape, by_column, dtype = npy.read_array_header_1_0(stream)
    if dtype.hasobject:
        raise ValueError(f"{entry.filename} contains pickled objects")
    if dtype.itemsize * prod(shape) != len(data) - stream.tell():
        raise ValueError(f"{entry.filename} is declared as {dtype} {shape} and has {len(data) - stream.tell()} bytes")
    return np.ndarray(shape, dtype, data, stream.tell(), order="F" if by_column else "C").copy()

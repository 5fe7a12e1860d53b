"""The arrays of a model file, read with suspicion: a file from anywhere costs little memory, and runs no code."""

from __future__ import annotations

import io
import zipfile
from math import prod
from pathlib import Path

import numpy as np
from numpy.lib import format as npy

from push_predictor.errors import ModelFileError

LARGEST = 1 << 30  # bytes unpacked; a model of 20 000 windows needs a hundredth of it
ENDING = ".npy"


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """All arrays of a zip archive, by name. Raises ModelFileError for whatever is no archive of whole arrays.

    The file is read once, so that one that is replaced meanwhile is the old or the new one; half of each fails the
    checksums.
    """
    try:
        if path.exists() and not path.is_file():
            raise ModelFileError(f"{path}: a folder, pipe or device is not accepted, give a model file")
        if (size := path.stat().st_size) > LARGEST:
            raise ModelFileError(f"{path}: holds {size} bytes, at most {LARGEST} are accepted")
        with zipfile.ZipFile(io.BytesIO(path.read_bytes())) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
            if unpacked > LARGEST:
                raise ModelFileError(f"{path}: unpacks to {unpacked} bytes, at most {LARGEST} are accepted")
            return {entry.filename.removesuffix(ENDING): _array(archive, entry) for entry in archive.infolist()}
    except ModelFileError:
        raise
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be read ({error.strerror or error})") from None
    except Exception as error:  # zip, its compressions and the headers of arrays have a dozen kinds of their own
        raise ModelFileError(f"{path}: not a model file, or a damaged one ({error})") from None


def _array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> np.ndarray:
    """One member. Read whole, even if it claims to hold a shorter array: only then its checksum is looked at."""
    with archive.open(entry) as member:
        data = member.read(entry.file_size)  # no more, however far it would unpack
    stream = io.BytesIO(data)
    version = npy.read_magic(stream)
    read_header = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}[version]
    shape, _, dtype = read_header(stream)
    if dtype.hasobject:
        raise ValueError(f"{entry.filename} holds pickled objects")
    if dtype.itemsize * prod(shape) != len(data) - stream.tell():
        raise ValueError(f"{entry.filename} claims to be {dtype} {shape} and holds {len(data) - stream.tell()} bytes")
    return npy.read_array(io.BytesIO(data), allow_pickle=False)

# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The arrays of a model file, read safely: a file of unknown origin costs little memory and runs no code."""

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
END = b"PK\x05\x06" + bytes(4)  # of an archive: how its last record begins
END_SIZE = 22  # bytes of that record


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """All arrays of a zip archive, by name. Raises ModelFileError for anything but an archive of complete arrays.

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
            return {entry.filename.removesuffix(ENDING): _array(archive, entry) for entry in archive.infolist()}
    except ModelFileError:
        raise
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be read ({error.strerror or error})") from None
    except Exception as error:  # zip, its compressions and the headers of arrays raise a dozen different classes
        raise ModelFileError(f"{path}: not a model file, or a damaged one ({error})") from None


def _array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> np.ndarray:
    """One member, read to its end even if its header declares a shorter array: only then is the checksum verified."""
    with archive.open(entry) as member:
        data = member.read(entry.file_size)  # no more, whatever it would unpack to
    stream = io.BytesIO(data)
    version = npy.read_magic(stream)
    read_header = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}[version]
    shape, _, dtype = read_header(stream)
    if dtype.hasobject:
        raise ValueError(f"{entry.filename} contains pickled objects")
    if dtype.itemsize * prod(shape) != len(data) - stream.tell():
        raise ValueError(f"{entry.filename} is declared as {dtype} {shape} and has {len(data) - stream.tell()} bytes")
    return npy.read_array(io.BytesIO(data), allow_pickle=False)

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Model files that are damaged, forged, of another version, or replaced under a running server."""

from __future__ import annotations

import io
import os
import pickle
import struct
import threading
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drifting_models import pushes
from synthetic import square_rig

from benchmarks.models.damaged_models import KINDS, damage, equal, predict_probes, undamaged_bytes, write_models
from push_predictor.errors import ModelFileError
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.train import train_model

pytestmark = pytest.mark.slow

COPIES = 40  # of each kind; `python -m benchmarks.models.damaged_models` tries as many as asked for
MEMORY = 30 << 20  # bytes that reading a forged file may take


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return write_models(tmp_path_factory.mktemp("models"))


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_copy_is_refused_or_predicts_like_the_original(
    files: dict[str, Path], kind: str, tmp_path: Path
) -> None:
    undamaged, other = undamaged_bytes(files, kind)
    expected, rng, refused = predict_probes(load_model(files[kind])), np.random.default_rng(len(undamaged)), 0
    path = tmp_path / "d.model"
    for _ in range(COPIES):
        path.write_bytes(data := damage(undamaged, other, rng))
        try:
            model = load_model(path)
        except ModelFileError as error:
            refused += 1
            assert str(error).startswith(f"{path}: ") and "\n" not in str(error)
        else:
            assert data == undamaged or equal(predict_probes(model), expected)  # the bits were in an unused part
    assert refused > 0.6 * COPIES


def test_rejects_a_whole_file_that_is_followed_by_the_end_of_another(files: dict[str, Path], tmp_path: Path) -> None:
    """A smaller model that was written over a larger one and did not shorten it."""
    path = tmp_path / "m.model"
    path.write_bytes(files["gp"].read_bytes() + files["vhgp"].read_bytes()[-300:-30])
    with pytest.raises(ModelFileError, match="does not end with the record"):
        load_model(path)


def test_rejects_array_with_a_smaller_declared_size(tmp_path: Path) -> None:
    """One flipped bit turns doubles into singles: half of the bytes are read, and no checksum is compared."""
    path = tmp_path / "m.model"
    model = train_model(pushes(300), square_rig(), "analytical", name="large")  # zipfile reads some kB ahead
    save_model(model, path)
    members = arrays_of(path)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, array in members.items():
            archive.writestr(f"{name}.npy", npy(array))
    assert equal(predict_probes(load_model(path)), predict_probes(model))
    data = path.read_bytes()
    assert data.count(b"'<f8'") >= 3
    at = data.index(b"'<f8'", data.index(b"training.outcomes.npy")) + 3
    path.write_bytes(data[:at] + b"4" + data[at + 1 :])
    with pytest.raises(ModelFileError, match=r"m\.model: .*Bad CRC-32 for file 'training.outcomes.npy'"):
        load_model(path)


# --- code ---------------------------------------------------------------------------------------------------------


class _Payload:
    """An object that creates a file when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.mark,)


def pickled(mark: Path) -> bytes:
    return pickle.dumps(_Payload(mark))


def objects(mark: Path) -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.array([_Payload(mark)], dtype=object), allow_pickle=True)
    return stream.getvalue()


@pytest.mark.parametrize("member", ["", "training.inputs.npy", "header.npy", "archive/data.pkl", "extra.npy"])
@pytest.mark.parametrize("payload", [pickled, objects])
def test_code_in_a_model_file_is_not_executed(
    files: dict[str, Path], member: str, payload: Callable[[Path], bytes], tmp_path: Path
) -> None:
    mark, path = tmp_path / "mark", tmp_path / "m.model"
    if member:
        write(path, {name: npy(array) for name, array in arrays_of(files["gp"]).items()} | {member: payload(mark)})
    else:
        path.write_bytes(payload(mark))
    registry = ModelRegistry()
    with pytest.raises(ModelFileError, match=r"m\.model: "):
        registry.load(path)
    assert not mark.exists() and not len(registry)
    np.load(io.BytesIO(objects(mark)), allow_pickle=True)
    assert mark.exists()  # unpickling would have run it


# --- forged files -------------------------------------------------------------------------------------------------


def peak_of(load: Callable[[], object]) -> int:
    tracemalloc.start()
    try:
        load()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("claimed", [100, 1 << 31])
def test_member_larger_than_declared_costs_no_memory(tmp_path: Path, claimed: int) -> None:
    path = tmp_path / "bomb.model"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("inputs.npy", bytes(100 << 20))
    data = bytearray(path.read_bytes())
    entry = data.rindex(b"PK\1\2")
    data[entry + 24 : entry + 28] = struct.pack("<I", claimed)
    path.write_bytes(data)

    def load() -> None:
        with pytest.raises(ModelFileError, match=r"bomb\.model: "):
            load_model(path)

    assert peak_of(load) < MEMORY


@pytest.mark.parametrize("shape", [(10**9, 3), (10**18, 3), (-1, 3), (2**63, 2**63)])
def test_array_with_a_huge_declared_size_costs_no_memory(
    files: dict[str, Path], shape: tuple[int, ...], tmp_path: Path
) -> None:
    header = repr({"descr": "<f8", "fortran_order": False, "shape": shape}).ljust(117).encode() + b"\n"
    path, members = tmp_path / "m.model", {name: npy(array) for name, array in arrays_of(files["gp"]).items()}
    write(
        path,
        members | {"training.inputs.npy": b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header + bytes(2400)},
    )

    def load() -> None:
        with pytest.raises(ModelFileError, match=r"m\.model: "):
            load_model(path)

    assert peak_of(load) < MEMORY


def test_array_with_surplus_bytes_is_refused(files: dict[str, Path], tmp_path: Path) -> None:
    path, members = tmp_path / "m.model", {name: npy(array) for name, array in arrays_of(files["gp"]).items()}
    write(path, members | {"training.inputs.npy": members["training.inputs"] + bytes(8)})
    with pytest.raises(
        ModelFileError, match=r"training\.inputs\.npy is declared as float64 \(75, 3\) and has 1808 bytes"
    ):
        load_model(path)


@pytest.mark.parametrize("place", ["~nobody_of_that_name/x", "a\0b", "x" * 300, "loop/x", "/dev/zero", "pipe"])
def test_unusable_path_is_reported_and_blocks_nothing(
    files: dict[str, Path], place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe")
    Path("loop").symlink_to("loop")
    registry, problems = ModelRegistry(), []
    loading = threading.Thread(
        target=lambda: problems.extend(registry.load_all([place, str(files["gp"])])), daemon=True
    )
    loading.start()
    loading.join(20.0)
    assert not loading.is_alive()
    assert len(problems) == 1 and place[:100].replace("\0", "\\x00").rstrip("/x") in problems[0]
    assert registry.names == ["gp"]


# --- under a running server ---------------------------------------------------------------------------------------


def arrays_of(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as archive:
        return {name: archive[name] for name in archive.files}


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=False)
    return stream.getvalue()


def write(path: Path, members: dict[str, bytes]) -> None:
    """Write a zip of these members; an array's name may omit its ending."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in {n if "." in n else f"{n}.npy": d for n, d in members.items()}.items():
            archive.writestr(name, data)

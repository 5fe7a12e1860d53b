# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models as the server predicts with them. Their tables are kept on disk: computing takes a second, reading a tenth.

A file of a table contains what the table is computed from. It is named by the digest of its model and by the version of
its format, and checked when it is read: its checksums, and its predictions at some pushes against those of the model.
`train` writes the tables of a model into a file next to the model file, and so does the package for the shipped model.
Other tables are computed and kept in $PUSH_PREDICTOR_CACHE, else in $XDG_CACHE_HOME/push_predictor, else in
~/.cache/push_predictor. A table that cannot be read or written is computed; nothing else depends on the folder, so it
may be deleted at any time.
"""

from __future__ import annotations

import ctypes
import gc
import os
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from push_predictor.blas_threads import one_blas_thread
from push_predictor.errors import ModelFileError
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.archive import archived, read_archive
from push_predictor.models.store.codec import Reader, encode
from push_predictor.models.store.model_file import load_model, model_digest
from push_predictor.models.tabulated.prediction_table import TableNodes, table_from_nodes
from push_predictor.models.tabulated.tabulated_model import (
    Probes,
    TableAccuracy,
    TabulatedModel,
    of_targets,
    probed,
    tabulate,
    with_table,
)
from push_predictor.recordings.atomic import write_whole
from push_predictor.resources import model_path
from push_predictor.types import Array

FOLDER = "PUSH_PREDICTOR_CACHE"  # environment variable
ENDING = ".tables"
FORMAT_VERSION = 6  # also to be raised when a table's values change their meaning
CHECKED = 10  # random pushes of the domain, as many training pushes, and as many outside the domain
PARTS: dict[str, Any] = {  # of a file: fields of PredictionTable, TableNodes, TableAccuracy and Probes, in their order
    "ends": tuple[Array, Array],
    "nodes": tuple[list[int], list[int], list[float], list[Array]],
    "error": tuple[float, float],
    "probes": tuple[Array, Array, Array, Array],
}
NO_TABLE_YET = "computed: its table is being computed"
MOST_TABLES = 20  # kept; the least recently used ones are deleted


@one_blas_thread()
def load_served(path: str | os.PathLike[str], *, at_once: bool = False) -> TabulatedModel:
    """The model of a file as the server predicts with it, its tables from disk where they are there.

    at_once: a model without tables on disk predicts by itself, and states that its table is missing; `completed` adds
    it. Raises ModelFileError as `load_model` does, and if the model cannot predict.
    """
    path = model_path(path)
    model = load_model(path, check=False)
    try:
        # The model of a kept table was checked before the table was computed.
        served = _read(model, path) or _without_tables(load_model(path))
        # The first prediction fills caches; no request should wait for that.
        first = model.examples(1)
        served.predict_rows(first.inputs, first.duration, first.covariates)
        return served if at_once else completed(served)
    except ModelFileError:
        raise
    except Exception as error:
        raise ModelFileError(f"{path}: the model cannot predict ({type(error).__name__}: {error})") from None


@one_blas_thread()
def completed(served: TabulatedModel) -> TabulatedModel:
    """A model that was loaded at once, with its tables; itself if it has them."""
    if served.how != NO_TABLE_YET:
        return served
    tabulated = _computed(served.model)
    tabulated.free_matrices()
    gc.collect()
    with suppress(AttributeError, OSError):  # another C library; glibc would keep 100 MB for later
        ctypes.CDLL(None).malloc_trim(0)
    return tabulated


@one_blas_thread()
def as_served(model: PushModel) -> TabulatedModel:
    """The model as the server predicts with it: with its table."""
    return _read(model, None) or _computed(model)


@one_blas_thread()
def keep_tables(model: PushModel, path: Path) -> None:
    """Write the tables of a model that was saved at this path next to it, so that no server has to compute them.

    Raises OSError. Does nothing for a device.
    """
    if not path.is_file():
        return
    write_tables(tables_of(path), model_digest(model), _read(model, None) or tabulate(model))


def tables_of(path: Path) -> Path:
    """The file of the tables of a model file."""
    return path.with_name(path.name + ENDING)


def table_folder() -> Path | None:
    """The folder of kept tables, there yet or not; None if no place for it is known."""
    if chosen := os.environ.get(FOLDER):
        return Path(chosen)
    if chosen := os.environ.get("XDG_CACHE_HOME"):
        return Path(chosen) / "push_predictor"
    try:
        return Path.home() / ".cache" / "push_predictor"
    except RuntimeError:  # a user without a home
        return None


def _read(model: PushModel, path: Path | None) -> TabulatedModel | None:
    """The model with its kept tables, None if there are none; path: of the model's file, if it is known."""
    digest = model_digest(model)
    if path is not None and (served := read_tables(tables_of(path), digest, model)) is not None:
        return served
    if (kept := _kept(digest)) is None or (served := read_tables(kept, digest, model)) is None:
        return None
    with suppress(OSError):
        os.utime(kept)  # the least recently used ones are deleted
    return served


def read_tables(path: Path, digest: str, model: PushModel) -> TabulatedModel | None:
    """The model with the tables of a file; None without a whole file of this model, or if they predict otherwise."""
    learnt = of_targets(model.base)
    if not isinstance(learnt.predictor, GaussianProcessPredictor):
        return None
    try:
        record, arrays = read_archive(path)
        if (record["format_version"], record["model"]) != (FORMAT_VERSION, digest):
            return None
        found = {name: Reader(arrays).read(record[name], hint, name) for name, hint in PARTS.items()}
        table = table_from_nodes(TableNodes(*found["nodes"]), learnt.predictor, found["ends"])
        accepted = Probes(*found["probes"]).error_of(table).accepted
    except (ModelFileError, ValueError, KeyError, TypeError, IndexError, AttributeError):
        return None
    return with_table(model, table, TableAccuracy(*found["error"])) if accepted else None


def write_tables(path: Path, digest: str, tabulated: TabulatedModel) -> None:
    """Write the table of a model with this digest, if it has one. Raises OSError."""
    table, error = tabulated.table, tabulated.error
    if table is None or error is None:
        return
    probes = probed(of_targets(tabulated.model.base), CHECKED)
    parts = {
        "ends": (table.least, table.most),
        "nodes": tuple(vars(table.nodes).values()),
        "error": tuple(vars(error).values()),
        "probes": tuple(vars(probes).values()),
    }
    arrays: dict[str, np.ndarray] = {}
    record = {name: encode(part, name, arrays) for name, part in parts.items()}
    write_whole(path, archived({"format_version": FORMAT_VERSION, "model": digest, **record}, arrays))


def _without_tables(model: PushModel) -> TabulatedModel:
    learns = isinstance(model.base.predictor, GaussianProcessPredictor)
    return TabulatedModel(model, NO_TABLE_YET) if learns else tabulate(model)


def _computed(model: PushModel) -> TabulatedModel:
    """The model with its tables, which are kept; a folder that takes no files is no error."""
    served, digest = tabulate(model), model_digest(model)
    if (kept := _kept(digest)) is not None:
        with suppress(OSError):
            write_tables(kept, digest, served)
            _delete_oldest(kept.parent)
    return served


def _kept(digest: str) -> Path | None:
    folder = table_folder()
    return None if folder is None else folder / f"{digest}.{FORMAT_VERSION}{ENDING}"


def _delete_oldest(folder: Path) -> None:
    files = sorted(folder.glob(f"*{ENDING}"), key=lambda file: file.stat().st_mtime, reverse=True)
    for file in files[MOST_TABLES:]:
        file.unlink(missing_ok=True)

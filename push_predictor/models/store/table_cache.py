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

"""Models as they are served, with their tables kept on disk: a table takes a second to compute and 20 ms to read.

A table is kept per content of a model file and per version of the code, in $PUSH_PREDICTOR_CACHE, else in
$XDG_CACHE_HOME/push_predictor, else in ~/.cache/push_predictor. It is checked when it is read: its checksum, and its
predictions at some pushes against those of the model. A table that cannot be read or written is computed; nothing else
depends on the folder, so it may be deleted at any time.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import zlib
from collections.abc import Mapping
from dataclasses import astuple
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from push_predictor.blas_threads import one_blas_thread
from push_predictor.errors import ModelFileError
from push_predictor.models import gaussian_process
from push_predictor.models.predictors import PriorPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.models.tabulated.interpolation import Axis, TensorSpline
from push_predictor.models.tabulated.prediction_table import PredictionTable
from push_predictor.models.tabulated.table_accuracy import Probes, TableAccuracy, probed
from push_predictor.models.tabulated.tabulated_domain import TabulatedDomain, feature_box
from push_predictor.models.tabulated.tabulated_model import (
    TabulatedModel,
    tabulate,
    with_base,
    with_domain,
    with_effect_table,
    without_mean,
)
from push_predictor.models.tabulated.tabulated_prior import TabulatedPrior, compared, with_spline
from push_predictor.recordings.atomic import write_whole
from push_predictor.types import Array

FOLDER = "PUSH_PREDICTOR_CACHE"  # environment variable
MOST_TABLES = 20  # kept; the least recently used ones are deleted
CHECKED = 10  # random pushes of the domain, and as many training pushes


@one_blas_thread()
def load_served(path: Path) -> TabulatedModel:
    """The model of a file as the server predicts with it, its table from the folder of kept tables where it is there.

    Raises ModelFileError as `load_model` does, and if the model cannot predict.
    """
    place = _place(path)
    kept = None if place is None else _read(place)
    model = load_model(path, check=kept is None)  # the model of a kept table was checked before the table was computed
    try:
        tabulated = None if kept is None else _restored(model, *kept)
        served = with_effect_table(tabulated or _computed(model, place))
        # The first prediction fills caches; no request should wait for that.
        first = model.examples(1)
        served.predict_rows(first.inputs, first.duration, first.covariates)
    except Exception as error:
        raise ModelFileError(f"{path}: the model cannot predict ({type(error).__name__}: {error})") from None
    return served


@one_blas_thread()
def keep_table(model: PushModel, path: Path) -> None:
    """Compute and keep the table of a model that was saved at this path, so that no server has to."""
    if (place := _place(path)) is not None and _read(place) is None:
        _computed(model, place)


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


def _place(path: Path) -> Path | None:
    """Where the table of a model file is kept, without an ending; None if it cannot be kept."""
    folder = table_folder()
    if folder is None or not path.is_file():
        return None
    try:
        content = path.read_bytes()
    except OSError:
        return None
    return folder / hashlib.sha256(content + _code()).hexdigest()[:32]


@lru_cache(maxsize=1)
def _code() -> bytes:
    """A digest of what a table depends on besides the model file: the modules of models, and numpy."""
    folder = Path(gaussian_process.__file__).parents[1]
    sources = sorted(folder.rglob("*.py"))
    digest = hashlib.sha256(np.__version__.encode())
    for source in sources:
        digest.update(source.read_bytes())
    return digest.digest()


def _read(place: Path) -> tuple[dict[str, Any], Array] | None:
    """What was kept there: the record and the coefficients; None without a whole table."""
    record_file, array_file = _files(place)
    try:
        record = json.loads(record_file.read_text())
        content = array_file.read_bytes()
        if zlib.crc32(content) != record["checksum"]:
            return None
        coefficients = np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
        os.utime(record_file)  # the least recently used ones are deleted
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return record, coefficients


def _restored(model: PushModel, record: Mapping[str, Any], coefficients: Array) -> TabulatedModel | None:
    """The model with a table that was kept; None unless the table predicts as the model did."""
    try:
        spline = TensorSpline([Axis(*axis) for axis in record["axes"]], coefficients)
        if isinstance(base := model.base.predictor, PriorPredictor):
            prior = with_spline(base, spline)
            return TabulatedModel(with_base(model, prior), record["how"]) if compared(base, prior, CHECKED)[1] else None
        table = PredictionTable(spline, slice(*record["columns"]), record["least"], record["knots"])
        probes = Probes(*(np.array(record["probes"][name]) for name in Probes.__dataclass_fields__))
        box = feature_box(model)
        domain = TabulatedDomain(box.chart, box.low, box.high, table)
        if not probes.error_of(domain).accepted:
            return None
        return with_domain(model, domain, TableAccuracy(*record["error"]))
    except (ValueError, KeyError, TypeError, IndexError):
        return None


def _computed(model: PushModel, place: Path | None) -> TabulatedModel:
    """The model with its table, which is kept."""
    tabulated = tabulate(model)
    base = tabulated.model.base.predictor
    if place is not None and tabulated.domain is not None and tabulated.error is not None:
        _keep(place, tabulated.domain.table.spline, _record(tabulated.model, tabulated.domain.table, tabulated.error))
    elif place is not None and isinstance(base, TabulatedPrior):
        _keep(place, base.spline, {"how": tabulated.how})
    return tabulated


def _record(model: PushModel, table: PredictionTable, error: TableAccuracy) -> dict[str, Any]:
    probes = probed(without_mean(model.base), CHECKED)
    return {
        "columns": [table.columns.start, table.columns.stop, table.columns.step],
        "least": table.least,
        "knots": table.knots,
        "error": astuple(error),
        "probes": {name: getattr(probes, name).tolist() for name in Probes.__dataclass_fields__},
    }


def _keep(place: Path, spline: TensorSpline, more: Mapping[str, Any]) -> None:
    """Write a table; a folder that takes no files is no error."""
    content = io.BytesIO()
    np.lib.format.write_array(content, spline.coefficients, allow_pickle=False)
    axes = [astuple(axis) for axis in spline.axes]
    record = {"checksum": zlib.crc32(content.getvalue()), "axes": axes, **more}
    record_file, array_file = _files(place)
    try:
        write_whole(array_file, content.getvalue())
        write_whole(record_file, json.dumps(record, allow_nan=False).encode())
        _delete_oldest(place.parent)
    except OSError:
        return


def _files(place: Path) -> tuple[Path, Path]:
    return place.with_suffix(".json"), place.with_suffix(".npy")


def _delete_oldest(folder: Path) -> None:
    records = sorted(folder.glob("*.json"), key=lambda record: record.stat().st_mtime, reverse=True)
    for record in records[MOST_TABLES:]:
        for file in _files(record):
            file.unlink(missing_ok=True)

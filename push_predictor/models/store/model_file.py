# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Saving and loading push models: one zip archive of arrays and a JSON record, never pickle.

What follows from the rig and the training rows is not stored: matrices, standardised inputs and outputs. So a file of
1000 windows stays under 200 kB and loads in well under a second.
"""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from push_predictor import __version__
from push_predictor.blas_threads import one_blas_thread
from push_predictor.errors import ModelFileError, PushPredictorError
from push_predictor.models.gaussian_process.gp import GaussianProcess
from push_predictor.models.gaussian_process.regression import ConstantNoise
from push_predictor.models.gaussian_process.sparse_vhgp import SparseVHGP
from push_predictor.models.gaussian_process.vhgp import VHGP
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.predictors import GaussianProcessPredictor, MechanicsPredictor, Predictor, PriorPredictor
from push_predictor.models.predictors.correlation import Correlation
from push_predictor.models.push_model import Provenance, PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.store.archive import ENDING, HEADER, archived, read_archive
from push_predictor.models.store.codec import APART, Reader, encode
from push_predictor.models.store.stored import REGRESSIONS
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.rig import Rig, rig_from_record
from push_predictor.recordings.table import PushTable
from push_predictor.resources import model_path
from push_predictor.types import Array

FORMAT = "push_predictor model"
FORMAT_VERSION = 9  # 1 to 8 were never released
PROBES = 5
OUTPUTS = "outputs"  # the array of what regressions were trained on, where that does not follow from the training rows
KINDS: dict[str, tuple[type, Any]] = {  # class of the base, and of its regressions
    "vhgp": (GaussianProcessPredictor, VHGP | SparseVHGP | ConstantNoise),
    "gp": (GaussianProcessPredictor, GaussianProcess | ConstantNoise),
    "analytical": (MechanicsPredictor, None),
    "prior": (PriorPredictor, None),
}


def save_model(model: PushModel, path: Path) -> None:
    """Write a model file; an older file at that path is replaced only when the new one is complete.

    Raises OSError that names the path.
    """
    record, arrays = _encoded(model)
    base = model.predictor.base
    if isinstance(base, GaussianProcessPredictor):
        training = Reader(arrays).read(record["training"], PushTable, "training")  # as it will be read
        if np.array_equal(_outputs(base, training), arrays[OUTPUTS]):
            del arrays[OUTPUTS]
    about = {"format": FORMAT, "format_version": FORMAT_VERSION, "written_by": __version__, "name": model.name}
    about["provenance"] = encode(model.provenance, "provenance", arrays)
    write_whole(path, archived(about | record, arrays))


@one_blas_thread()
def load_model(path: str | os.PathLike[str], *, check: bool = True) -> PushModel:
    """Read a model file. Raises ModelFileError if it is absent, damaged, not a model file, or of another version.

    path: of the file, or "default" for the model that ships with the package.
    check: predict some training pushes, which computes the matrices of the regressions.
    """
    path = model_path(path)
    record, arrays = read_archive(path)
    if record.get("format") != FORMAT:
        raise ModelFileError(f"{path}: format {record.get('format')!r} is not accepted, give a {FORMAT!r}")
    if (version := record.get("format_version")) != FORMAT_VERSION or isinstance(version, bool | float):
        raise ModelFileError(
            f"{path}: format version {version!r}, written by push_predictor {record.get('written_by')!r}; "
            f"push_predictor {__version__} reads version {FORMAT_VERSION} only: train the model again"
        )
    try:
        with np.errstate(all="ignore"):
            model = _model(record, arrays, str(path))
            if check:
                _check_answers(model)
        return model
    except PushPredictorError as error:
        raise ModelFileError(f"{path}: the model file is damaged ({error})") from None
    except Exception as error:  # any other failure of the computation is caused by the values in the file
        raise ModelFileError(f"{path}: the model file is damaged ({type(error).__name__}: {error})") from None


def model_digest(model: PushModel) -> str:
    """A hash of what determines the predictions of a model: the same for a model and its file."""
    record, arrays = _encoded(model)
    digest = hashlib.sha256(json.dumps(record, sort_keys=True).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype} {array.shape}".encode() + array.tobytes())
    return digest.hexdigest()[:32]


def is_model_file(path: Path) -> bool:
    """Whether a file looks like a model file, whatever its version or state."""
    member = f"{HEADER}{ENDING}"
    try:
        with path.open("rb") as stream:
            start = stream.read(30 + len(member))
        if start[:4] == b"PK\3\4" and start[30:] == member.encode():
            return True  # even if the file is cut short: the list of a zip's members is at its end
        with zipfile.ZipFile(path) as archive:
            return member in archive.namelist()
    except Exception:  # zipfile raises several classes of its own
        return False


def _encoded(model: PushModel) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """What determines the predictions of a model: record and arrays."""
    arrays: dict[str, np.ndarray] = {}
    base = model.predictor.base
    learnt = base if isinstance(base, GaussianProcessPredictor) else None
    parts = {
        "training": model.training,
        "predictor": model.predictor,
        "regressions": learnt.regressions if learnt else (),
        "correlation": learnt.correlation if learnt else None,
    }
    record = {name: encode(part, name, arrays) for name, part in parts.items()}
    if learnt:
        arrays[OUTPUTS] = np.column_stack([regression.outputs for regression in learnt.regressions])
    return {"kind": model.kind, "rig": model.rig.to_record(), **record}, arrays


def _model(record: dict[str, Any], arrays: dict[str, np.ndarray], source: str) -> PushModel:
    reader = Reader(arrays)
    name, kind = (reader.read(record[key], str, key) for key in ("name", "kind"))
    if kind not in KINDS:
        raise ValueError(f"kind {kind!r} is not accepted, give one of {', '.join(KINDS)}")
    rig = rig_from_record(record["rig"], source)
    training = reader.read(record["training"], PushTable, "training")
    provenance = reader.read(record["provenance"], Provenance, "provenance")
    predictor = _predictor(record, kind, rig, training, arrays)
    return PushModel(name, kind, rig, predictor, training, provenance)


def _predictor(
    record: dict[str, Any], kind: str, rig: Rig, training: PushTable, arrays: dict[str, np.ndarray]
) -> Predictor:
    given: dict[tuple[type, str], Any] = {
        (PushMechanics, "outline"): rig.outline,
        (PushMechanics, "pusher_radius"): rig.pusher_radius,
        (GaussianProcessPredictor, "rig"): rig,
        (GaussianProcessPredictor, "regressions"): (),
        (GaussianProcessPredictor, "correlation"): None,
    }
    predictor: Predictor = Reader(arrays, given).read(record["predictor"], Predictor, "predictor")
    if missing := [name for name in predictor.needs if name not in training.covariates]:
        raise ValueError(f"predictor: needs the covariate {missing[0]}, which the training rows lack")
    of_base, of_regression = KINDS[kind]
    if not isinstance(base := predictor.base, of_base):
        raise ValueError(f"predictor: {type(base).__name__} is not accepted for kind {kind!r}, give {of_base.__name__}")
    if not isinstance(base, GaussianProcessPredictor):
        return predictor
    inputs = base.scaling.features(rig.outline, training.inputs)
    stored = OUTPUTS in arrays
    outputs = Reader(arrays).read(APART, Array, OUTPUTS) if stored else _outputs(base, training)
    if outputs.shape != training.outcomes.shape or len(record["regressions"]) != outputs.shape[1]:
        raise ValueError(
            f"{OUTPUTS} of shape {outputs.shape}, {training.outcomes.shape} and as many regressions needed"
        )
    regressions = []
    for k, (found, column) in enumerate(zip(record["regressions"], outputs.T.copy(), strict=True)):
        given = {(cls, name): x for cls in REGRESSIONS for name, x in (("inputs", inputs), ("outputs", column))}
        regressions.append(Reader(arrays, given).read(found, of_regression, f"regressions.{k}"))
    reader = Reader(arrays, {(Correlation, "features"): inputs})
    correlation = reader.read(record["correlation"], Correlation | None, "correlation")
    if correlation is not None and correlation.rows is not None:
        correlation = replace(correlation, features=inputs[correlation.rows])
    return predictor.with_base(replace(base, regressions=tuple(regressions), correlation=correlation))


def _outputs(base: GaussianProcessPredictor, training: PushTable) -> Array:
    """What the regressions of a base without effects were trained on (n, 3)."""
    return base.standardised(Push.of(training), training.outcomes)


def _check_answers(model: PushModel) -> None:
    """Raise ValueError unless some training pushes get finite predictions with positive definite covariances."""
    rows = model.examples(PROBES)
    found = model.predict_rows(rows.inputs, rows.duration, rows.covariates)
    for name, values in (("mean", found.mean), ("covariance", found.covariance)):
        if not np.all(np.isfinite(values)):
            raise ValueError(f"the {name} of a training push is not finite")
    if np.any(np.linalg.eigvalsh(found.covariance) <= 0.0):
        raise ValueError("the covariance of a training push is not positive definite")

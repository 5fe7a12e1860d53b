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

"""Saving and loading push models: one zip archive of arrays and a JSON header, never pickle.

The regressions' matrices are not stored (regression_record.py), so a file of 1000 windows stays under 200 kB and loads
in well under a second.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from push_predictor import __version__
from push_predictor.blas_threads import one_blas_thread
from push_predictor.errors import ModelFileError, PushPredictorError
from push_predictor.models.push_model import KINDS, Provenance, PushModel
from push_predictor.models.store.arrays_record import read_arrays
from push_predictor.models.store.predictor_record import Source, predictor_of, predictor_record
from push_predictor.models.store.sparse_record import has_inducing
from push_predictor.models.store.table_record import table_arrays, table_of
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.rig import rig_from_record

FORMAT = "push_predictor model"
# What each version added. 2: kernels other than the squared exponential, and a nugget. 3: effects. 4: effects that
# share a covariance. 5: correlated outputs, and inducing inputs. 6: fitted mechanics, alone or as mean,
# and draws of their parameters, with which a model may have no training rows. 7: effects that change these parameters.
# 8: tails.
FORMAT_VERSION = 8
PROBES = 5
HEADER = "header"
PREDICTOR = "body"  # the header's key of the predictor's record


def save_model(model: PushModel, path: Path) -> None:
    """Write a model file; an older file at that path is replaced only when the new one is complete.

    Raises OSError that names the path.
    """
    arrays = table_arrays(model.training)
    header = _header(model, arrays)
    buffer = io.BytesIO()
    arrays[HEADER] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    write_whole(path, buffer.getvalue())


@one_blas_thread()
def load_model(path: str | os.PathLike[str], *, check: bool = True) -> PushModel:
    """Read a model file. Raises ModelFileError if it is absent, damaged, not a model file, or of a newer version.

    check: predict some training pushes, which computes the matrices of the regressions.
    """
    path = Path(path)
    arrays = read_arrays(path)
    header = _read_header(path, arrays)
    try:
        with np.errstate(all="ignore"):
            model = _model(header, arrays, str(path))
            if check:
                _check_answers(model)
        return model
    except PushPredictorError as error:
        raise ModelFileError(f"{path}: the model file is damaged ({error})") from None
    except Exception as error:  # any other failure of the computation is caused by the values in the file
        raise ModelFileError(f"{path}: the model file is damaged ({type(error).__name__}: {error})") from None


def model_digest(model: PushModel) -> str:
    """A hash of what determines the predictions of a model: the same for a model and its file, of whatever version."""
    arrays = table_arrays(model.training)
    header = _header(model, arrays)
    known = {key: header[key] for key in ("kind", "rig", "covariates", PREDICTOR)}
    digest = hashlib.sha256(json.dumps(known, sort_keys=True).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype} {array.shape}".encode() + array.tobytes())
    return digest.hexdigest()[:32]


def is_model_file(path: Path) -> bool:
    """Whether a file looks like a model file, whatever its version or state."""
    try:
        with path.open("rb") as stream:
            start = stream.read(40)
        if start[:4] == b"PK\3\4" and start[30:] == b"inputs.npy":
            return True  # even if the file is cut short: the list of a zip's members is at its end
        with zipfile.ZipFile(path) as archive:
            return f"{HEADER}.npy" in archive.namelist()
    except Exception:  # zipfile raises several classes of its own
        return False


def _read_header(path: Path, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    try:
        header = json.loads(arrays.pop(HEADER).tobytes().decode())
        found, version = header["format"], header["format_version"]
    except (KeyError, TypeError, ValueError, RecursionError):
        raise ModelFileError(f"{path}: contains no header of a push_predictor model") from None
    if found != FORMAT:
        raise ModelFileError(f"{path}: format {found!r} is not accepted, give a {FORMAT!r}")
    if isinstance(version, bool) or not isinstance(version, int) or version < 1:
        raise ModelFileError(f"{path}: format version {version!r} is not accepted, give 1 to {FORMAT_VERSION}")
    if version > FORMAT_VERSION:
        raise ModelFileError(
            f"{path}: format version {version!r}, written by push_predictor {header.get('written_by')!r}; "
            f"this is push_predictor {__version__}, which reads up to version {FORMAT_VERSION}: update it"
        )
    return dict(header)


def _header(model: PushModel, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    predictor = predictor_record(model.predictor, arrays)
    return {
        "format": FORMAT,
        "format_version": _version(predictor, arrays),
        "written_by": __version__,
        "name": model.name,
        "kind": model.kind,
        "rig": model.rig.to_record(),
        "provenance": {**vars(model.provenance), "sources": list(model.provenance.sources)},
        "covariates": list(model.training.covariates),
        PREDICTOR: predictor,
    }


def _version(predictor: dict[str, Any], arrays: dict[str, np.ndarray]) -> int:
    """The lowest version whose readers understand the record of a predictor."""
    base = predictor.get("base", predictor)
    if "tails" in base:
        return 8
    if any("exact" in effect for effect in predictor.get("effects", ())):
        return 7
    if {"mechanics", "mean"} & base.keys():
        return 6
    if "correlation" in base or has_inducing(0, arrays):
        return 5
    if "effects" in predictor:
        return 4 if "cross" in predictor else 3
    return 2 if any({"family", "log_nugget_sd"} & r.keys() for r in predictor.get("regressions", ())) else 1


def _model(header: dict[str, Any], arrays: dict[str, np.ndarray], source: str) -> PushModel:
    if header["kind"] not in KINDS:
        raise ValueError(f"kind {header['kind']!r} is not accepted, give one of {', '.join(KINDS)}")
    rig = rig_from_record(header["rig"], source)
    training = table_of(header["covariates"], arrays)
    found = header["provenance"]
    provenance = Provenance(tuple(found["sources"]), int(found["pushes"]), int(found["seed"]), str(found["version"]))
    predictor = predictor_of(header[PREDICTOR], Source(header["kind"], rig, training, arrays))
    return PushModel(str(header["name"]), str(header["kind"]), rig, predictor, training, provenance)


def _check_answers(model: PushModel) -> None:
    """Raise ValueError unless some training pushes get finite predictions with positive definite covariances."""
    rows = model.examples(PROBES)
    found = model.predict_rows(rows.inputs, rows.duration, rows.covariates)
    for name, values in (("mean", found.mean), ("covariance", found.covariance)):
        if not np.all(np.isfinite(values)):
            raise ValueError(f"the {name} of a training push is not finite")
    if np.any(np.linalg.eigvalsh(found.covariance) <= 0.0):
        raise ValueError("the covariance of a training push is not positive definite")

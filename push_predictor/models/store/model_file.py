"""Saving and loading push models: one zip archive of arrays and a JSON header, never pickle.

The regressions' matrices are not stored. They follow from the training rows, the hyperparameters and, for the VHGP, the
site precisions, so a file of 1000 windows stays under 200 kB and loads in well under a second.
"""

from __future__ import annotations

import io
import json
import os
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from push_predictor import __version__
from push_predictor.errors import ModelFileError, PushPredictorError
from push_predictor.models.gaussian_process.gp import GaussianProcess, GpParameters
from push_predictor.models.gaussian_process.kernels import DEFAULT_CHOICE, FAMILIES
from push_predictor.models.gaussian_process.sparse.vhgp import SparseVHGP
from push_predictor.models.gaussian_process.vhgp import VHGP
from push_predictor.models.gaussian_process.vhgp_parameters import VhgpParameters
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.limit_surface import Support
from push_predictor.models.push_model import (
    KINDS,
    AnalyticalPredictor,
    ExtendedPredictor,
    GaussianProcessPredictor,
    Provenance,
    PushModel,
    Scaling,
    scaled_features,
)
from push_predictor.models.store.arrays_record import read_arrays
from push_predictor.models.store.correlation_record import correlation_of, correlation_record
from push_predictor.models.store.effects_record import cross_of, cross_record, effects_of, effects_record
from push_predictor.models.store.sparse_record import has_inducing, put_inducing, sparse_regression
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.rig import Rig, rig_from_record
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

FORMAT = "push_predictor model"
# 2: other kernels than the squared exponential, and a nugget; 3: effects; 4: effects that share a covariance;
# 5: outputs that go together, and inducing inputs
FORMAT_VERSION = 5
PROBES = 5
LONGEST_WAY = 10.0  # m
LARGEST_RATIO = 100.0  # of the support's or the pusher's size to the outline's
HEADER = "header"


def save_model(model: PushModel, path: Path) -> None:
    """Write a model file; an older file at that path is replaced only when the new one is complete.

    Raises OSError that names the path.
    """
    arrays = _table_arrays(model.training)
    header = _header(model, arrays)
    buffer = io.BytesIO()
    arrays[HEADER] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    write_whole(path, buffer.getvalue())


def load_model(path: str | os.PathLike[str]) -> PushModel:
    """Read a model file. Raises ModelFileError if it is absent, damaged, foreign or of a newer version."""
    path = Path(path)
    arrays = read_arrays(path)
    header = _read_header(path, arrays)
    try:
        with np.errstate(all="ignore"):
            model = _model(header, arrays, str(path))
            _check_answers(model)
        return model
    except PushPredictorError as error:
        raise ModelFileError(f"{path}: the model file is damaged ({error})") from None
    except Exception as error:  # whatever a file makes the mathematics do, it is the file's fault
        raise ModelFileError(f"{path}: the model file is damaged ({type(error).__name__}: {error})") from None


def is_model_file(path: Path) -> bool:
    """Whether a file looks like one of ours, whatever its version or state."""
    try:
        with path.open("rb") as stream:
            start = stream.read(40)
        if start[:4] == b"PK\3\4" and start[30:] == b"inputs.npy":
            return True  # cut off further on, perhaps: the list of a zip's members is at its end
        with zipfile.ZipFile(path) as archive:
            return f"{HEADER}.npy" in archive.namelist()
    except Exception:  # zipfile has several kinds of its own
        return False


def _read_header(path: Path, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    try:
        header = json.loads(arrays.pop(HEADER).tobytes().decode())
        found, version = header["format"], header["format_version"]
    except (KeyError, TypeError, ValueError, RecursionError):
        raise ModelFileError(f"{path}: holds no header of a push_predictor model") from None
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
    predictor = _body_header(model.predictor, arrays)
    return {
        "format": FORMAT,
        "format_version": 5 if has_inducing(0, arrays) else _version(predictor),
        "written_by": __version__,
        "name": model.name,
        "kind": model.kind,
        "rig": model.rig.to_record(),
        "provenance": {**vars(model.provenance), "sources": list(model.provenance.sources)},
        "covariates": list(model.training.covariates),
        "body": predictor,
    }


def _version(predictor: dict[str, Any]) -> int:
    """The lowest version whose readers understand a body."""
    if "correlation" in predictor.get("base", predictor):
        return 5
    if "effects" in predictor:
        return 4 if "cross" in predictor else 3
    return 2 if any({"family", "log_nugget_sd"} & r.keys() for r in predictor.get("regressions", ())) else 1


def _model(header: dict[str, Any], arrays: dict[str, np.ndarray], source: str) -> PushModel:
    if header["kind"] not in KINDS:
        raise ValueError(f"kind {header['kind']!r}, known are {', '.join(KINDS)}")
    rig = rig_from_record(header["rig"], source)
    training = _table(header, arrays)
    found = header["provenance"]
    provenance = Provenance(tuple(found["sources"]), int(found["pushes"]), int(found["seed"]), str(found["version"]))
    predictor = _predictor(header["body"], header["kind"], rig, training, arrays)
    return PushModel(str(header["name"]), str(header["kind"]), rig, predictor, training, provenance)


def _check_answers(model: PushModel) -> None:
    """Raise ValueError unless the model gives some of its own training pushes a Gaussian."""
    rows = model.training.take(np.linspace(0, len(model.training) - 1, PROBES).astype(int))
    found = model.predict_rows(rows.inputs, rows.duration, rows.covariates)
    for name, values in (("mean", found.mean), ("covariance", found.covariance)):
        if not np.all(np.isfinite(values)):
            raise ValueError(f"the {name} of a training push is not finite")
    if np.any(np.linalg.eigvalsh(found.covariance) <= 0.0):
        raise ValueError("the covariance of a training push is not positive definite")


# --- the training rows ----------------------------------------------------------------------------------------------


def _table_arrays(table: PushTable) -> dict[str, np.ndarray]:
    pushes = table.pushes
    index = {push: k for k, push in enumerate(pushes)}
    arrays: dict[str, np.ndarray] = {
        "inputs": table.inputs,
        "duration": table.duration,
        "outcomes": table.outcomes,
        "pushes": np.array(pushes),
        "push_of_row": np.array([index[push] for push in table.push_id.tolist()], dtype=np.int32),
    }
    for k, column in enumerate(table.covariates.values()):
        arrays[f"covariate_{k}"] = column.astype(np.float32)  # conditions, not regression inputs: 7 digits do
    return arrays


def _table(header: dict[str, Any], arrays: dict[str, np.ndarray]) -> PushTable:
    covariates = {name: arrays[f"covariate_{k}"].astype(float) for k, name in enumerate(header["covariates"])}
    push_id = arrays["pushes"][arrays["push_of_row"]]
    inputs, duration = _finite(arrays, "inputs"), _finite(arrays, "duration")
    table = PushTable(inputs, duration, _finite(arrays, "outcomes"), push_id, covariates)
    if not np.all(np.abs(inputs[:, 0] * duration) < LONGEST_WAY):
        raise ValueError(f"a training push is longer than {LONGEST_WAY:g} m")
    return table


def _finite(arrays: dict[str, np.ndarray], name: str) -> Array:
    column = np.asarray(arrays[name], dtype=np.float64)
    if not np.all(np.isfinite(column)):
        raise ValueError(f"{name} holds a value that is not finite")
    return column


# --- the bodies -----------------------------------------------------------------------------------------------------


def _body_header(
    predictor: GaussianProcessPredictor | AnalyticalPredictor | ExtendedPredictor, arrays: dict[str, np.ndarray]
) -> dict[str, Any]:
    if isinstance(predictor, ExtendedPredictor):
        if isinstance(predictor.base, GaussianProcessPredictor):
            arrays["base_outcomes"] = predictor.base.outcomes  # those of the training rows less the effects
        return {
            "base": _body_header(predictor.base, arrays),
            "physics": _physics_header(predictor.physics),
            "effects": effects_record(predictor.effects, arrays),
            "scale": predictor.scale.tolist(),
            **({"cross": cross_record(predictor.cross, arrays)} if predictor.cross else {}),
        }
    if isinstance(predictor, AnalyticalPredictor):
        return {**_physics_header(predictor.physics), "covariance": predictor.covariance.tolist()}
    for k, regression in enumerate(predictor.regressions):
        if isinstance(regression, VHGP | SparseVHGP):
            arrays[f"site_precisions_{k}"] = regression.site_precisions
        if isinstance(regression, SparseVHGP):
            put_inducing(regression, k, arrays)
    scaling = {key: np.asarray(value).tolist() for key, value in vars(predictor.scaling).items()}
    return {
        "scaling": scaling,
        "regressions": [_parameters_header(r) for r in predictor.regressions],
        **({"correlation": correlation_record(predictor.correlation, arrays)} if predictor.correlation else {}),
    }


def _physics_header(physics: AnalyticalPush) -> dict[str, Any]:
    support = physics.support
    return {
        "contact_friction": physics.contact_friction,
        "centre": list(support.centre),
        "length": support.length,
    }


def _parameters_header(regression: GaussianProcess | VHGP | SparseVHGP) -> dict[str, Any]:
    """The hyperparameters, without those that version 1 did not know where they are what it took for granted."""
    values = dict(vars(regression.parameters))
    if values["family"] == DEFAULT_CHOICE.family:
        del values["family"]
    chosen = {key: value for key, value in values.items() if value is not None}
    return {key: value if key == "family" else np.asarray(value).tolist() for key, value in chosen.items()}


def _predictor(
    header: dict[str, Any], kind: str, rig: Rig, training: PushTable, arrays: dict[str, np.ndarray]
) -> GaussianProcessPredictor | AnalyticalPredictor | ExtendedPredictor:
    if "effects" in header:
        return _extended_body(header, kind, rig, training, arrays)
    return _base_body(header, kind, rig, training, arrays)


def _base_body(
    header: dict[str, Any], kind: str, rig: Rig, training: PushTable, arrays: dict[str, np.ndarray]
) -> GaussianProcessPredictor | AnalyticalPredictor:
    if kind == "analytical":
        return _analytical_body(header, rig)
    return _learned_body(header, kind, rig, training, arrays)


def _extended_body(
    header: dict[str, Any], kind: str, rig: Rig, training: PushTable, arrays: dict[str, np.ndarray]
) -> ExtendedPredictor:
    effects, scale = effects_of(header["effects"], arrays), np.array(header["scale"], dtype=np.float64)
    if scale.shape != (3,) or not np.all(np.isfinite(scale)) or np.any(scale <= 0.0):
        raise ValueError(f"scale {header['scale']!r}, three finite numbers above 0 are needed")
    rows = training if kind == "analytical" else replace(training, outcomes=_finite(arrays, "base_outcomes"))
    base = _base_body(header["base"], kind, rig, rows, arrays)
    cross = cross_of(header.get("cross", []), effects, arrays)
    predictor = ExtendedPredictor(base, _physics(header["physics"], rig), effects, scale, cross)
    if missing := [name for name in predictor.needs if name not in training.covariates]:
        raise ValueError(f"an effect needs the covariate {missing[0]}, which the training rows do not hold")
    return predictor


def _physics(header: dict[str, Any], rig: Rig) -> AnalyticalPush:
    x, y = header["centre"]
    support = Support((float(x), float(y)), float(header["length"]))
    reach = float(np.abs(rig.outline.vertices).max())
    largest = max(abs(support.centre[0]), abs(support.centre[1]), support.length, rig.pusher_radius)
    if not (largest < LARGEST_RATIO * reach and support.length > reach / LARGEST_RATIO):
        raise ValueError("support or pusher are out of all proportion to the outline")  # integrating would never end
    return AnalyticalPush(rig.outline, rig.pusher_radius, float(header["contact_friction"]), support)


def _analytical_body(header: dict[str, Any], rig: Rig) -> AnalyticalPredictor:
    physics = _physics(header, rig)
    covariance = np.array(header["covariance"], dtype=np.float64)
    np.linalg.cholesky(covariance)  # a damaged covariance must not be served
    return AnalyticalPredictor(physics, covariance)


def _learned_body(
    header: dict[str, Any], kind: str, rig: Rig, training: PushTable, arrays: dict[str, np.ndarray]
) -> GaussianProcessPredictor:
    found = header["scaling"]
    columns = tuple(int(c) for c in found.pop("columns"))
    scaling = Scaling(columns, **{key: np.array(value, dtype=np.float64) for key, value in found.items()})
    features = scaled_features(rig, scaling, training.inputs)
    scaled = (training.outcomes - scaling.outcome_mean) / scaling.outcome_sd
    regressions = [
        _regression(kind, features, scaled[:, k], parameters, k, arrays)
        for k, parameters in enumerate(header["regressions"])
    ]
    if len(regressions) != training.outcomes.shape[1]:
        raise ValueError(f"{len(regressions)} regressions, three are needed")
    correlation = correlation_of(header["correlation"], features, arrays) if "correlation" in header else None
    return GaussianProcessPredictor(rig, scaling, tuple(regressions), correlation)


def _regression(
    kind: str, features: Array, column: Array, parameters: dict[str, Any], output: int, arrays: dict[str, np.ndarray]
) -> GaussianProcess | VHGP | SparseVHGP:
    values, sites = _hyperparameters(parameters), arrays.get(f"site_precisions_{output}")
    if kind == "gp":
        return GaussianProcess(features, column, GpParameters(**values))
    if sites is None or sites.shape != column.shape or not np.all(np.isfinite(sites)) or np.any(sites < 0.0):
        raise ValueError(f"site precisions are missing or not {len(column)} finite numbers from 0 on")
    if has_inducing(output, arrays):
        return sparse_regression(features, column, VhgpParameters(**values), sites, output, arrays)
    return VHGP(features, column, VhgpParameters(**values), sites)


def _hyperparameters(header: dict[str, Any]) -> dict[str, Any]:
    values: dict[str, Any] = dict(header)
    family = values.pop("family", DEFAULT_CHOICE.family)
    if family not in FAMILIES:
        raise ValueError(f"kernel family {family!r}, known are {', '.join(FAMILIES)}")
    values = {k: np.array(v, dtype=np.float64) if isinstance(v, list) else float(v) for k, v in values.items()}
    if not all(np.all(np.isfinite(value)) for value in values.values()):
        raise ValueError("a hyperparameter is not finite")
    return {**values, "family": family}

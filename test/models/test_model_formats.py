# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Every kind of model: alone or among others, from its table or its file; what no model has is refused."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drifting_models import pushes
from synthetic import noisy_pushes, square_rig

from push_predictor.errors import ModelFileError
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.gaussian_process.regression import ConstantNoise, ConstantParameters
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.pressure import supported_at
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors import (
    ExtendedPredictor,
    GaussianProcessPredictor,
    MechanicsPredictor,
    PriorPredictor,
)
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.archive import archived, read_archive
from push_predictor.models.store.codec import Reader, encode
from push_predictor.models.store.model_file import FORMAT_VERSION, is_model_file, load_model, model_digest, save_model
from push_predictor.models.store.stored import CLASSES, GIVEN
from push_predictor.models.store.table_cache import read_tables, write_tables
from push_predictor.models.tabulated.tabulated_model import (
    COVARIANCE_TOLERANCE,
    MEAN_TOLERANCE,
    TabulatedModel,
    tabulate,
)
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable, empty_table
from push_predictor.types import Array

CORNERS = np.array([[0.04, 0.04, 0.2], [-0.04, 0.04, 0.3], [-0.04, -0.04, 0.1], [0.04, -0.03, 0.39], [0.01, 0.0, 0.17]])
INPUTS = np.array([[0.02, 0.1, 0.0], [0.02, 0.35, -0.4], [0.02, 0.8, 0.5], [0.06, 0.6, 1.2]])  # the last: beyond
DURATION = np.full(4, 0.2)
COVARIATES = {
    "elapsed_time": np.array([0.0, 10.0, 20.0, 0.0]),
    "push_heading": np.array([0.3, -2.0, 1.1, 0.3]),
    "recording": np.array([1.0, 2.0, 1.0, 1.0]),
}
PARTS = ("mean", "covariance", "process_covariance", "in_domain")
LEARNT = ("gp", "vhgp", "sparse vhgp", "gp about mechanics")


def table() -> PushTable:
    """Covariates have the seven digits that a file keeps of them."""
    rows, rng = noisy_pushes(40), np.random.default_rng(3)
    covariates = {name: np.round(64.0 * rng.uniform(0.0, 20.0, 40)) / 64.0 for name in ("elapsed_time", "push_heading")}
    covariates["recording"] = 1.0 + np.arange(40) % 2
    return replace(
        rows, covariates={name: column.astype(np.float32).astype(np.float64) for name, column in covariates.items()}
    )


@pytest.fixture(scope="module")
def models() -> dict[str, PushModel]:
    """A small model of every kind."""
    rows, rig = table(), square_rig()
    zero = TrainingOptions(mean="zero", per_path=False)
    trained = {kind: train_model(rows, rig, kind, name=kind, options=zero) for kind in ("gp", "vhgp", "analytical")}
    sparse = TrainingOptions(inducing=10, mean="zero")
    trained["sparse vhgp"] = train_model(rows, rig, "vhgp", name="s", options=sparse)
    trained["gp about mechanics"] = train_model(rows, rig, "gp", name="m", options=TrainingOptions(mean="mechanics"))
    on_corners = replace(rig, support_points=CORNERS)
    trained["prior"] = train_model(empty_table(), on_corners, "prior", name="prior")
    known = {1: supported_at(CORNERS), 2: supported_at(CORNERS * [1.1, 0.9, 1.0])}
    mechanics = PushMechanics(rig.outline, rig.pusher_radius, None, known)
    fitted = FittedMechanics(mechanics, {"contact_friction": 0.21, "grain_x": 0.1}, 1e-3 * np.eye(2))
    of_supports = MechanicsPredictor(fitted, np.diag([1e-8, 1e-8, 1e-5]))
    trained["fitted on supports"] = replace(trained["analytical"], predictor=of_supports)
    trained |= {f"{kind}, extended": extended(trained[kind]) for kind in (*LEARNT, "analytical", "prior")}
    needed = replace(rows, covariates={"elapsed_time": np.arange(40.0)})  # which the effects need
    trained["prior, extended"] = replace(trained["prior, extended"], training=needed)
    trained["with constant noise"] = with_constant_noise(trained["vhgp"])
    trained["correlation of some rows"] = with_some_rows(trained["gp"])
    trained["with tails"] = train_model(pushes(60), rig, "gp", name="tailed", options=TrainingOptions(mean="zero"))
    return trained


@pytest.fixture(scope="module")
def tables(models: dict[str, PushModel]) -> dict[str, TabulatedModel]:
    return {name: tabulate(models[name]) for name in NAMES}


def extended(base: PushModel) -> PushModel:
    """The base with two effects that share a covariance, and the generic one; its regressions learnt other outcomes."""
    drift = DriverBasis("linear", ("elapsed_time",), (5.0,), (3.0,))
    sizes = {"contact_friction": 1, "pusher_radius": 1, None: 18}
    effects = tuple(
        Effect(name, "elapsed_time", drift, np.full(m, 1e-3), 1e-8 * np.eye(m), np.array([0.02, 0.02, 0.5]))
        for name, m in sizes.items()
    )
    predictor = base.predictor.base
    if isinstance(predictor, GaussianProcessPredictor):
        moved = replace(base, training=replace(base.training, outcomes=base.training.outcomes + [1e-4, 0.0, 1e-3]))
        base = replace(moved, predictor=predictor)
    cross = {(0, 1): np.array([[5e-9]])}
    return replace(base, predictor=ExtendedPredictor(predictor, effects, np.array([0.9, 1.0, 1.2]), cross))


def with_constant_noise(model: PushModel) -> PushModel:
    predictor = model.predictor
    assert isinstance(predictor, GaussianProcessPredictor)
    first, second, third = predictor.regressions
    constant = ConstantNoise(second.inputs, second.outputs, ConstantParameters(-0.3, 0.4))
    return replace(model, predictor=replace(predictor, regressions=(first, constant, third)))


def with_some_rows(model: PushModel) -> PushModel:
    predictor, rows = model.predictor, np.arange(0, 40, 3)[::-1].copy()
    assert isinstance(predictor, GaussianProcessPredictor) and predictor.correlation is not None
    known = predictor.correlation
    some = replace(known, features=known.features[rows], residuals=known.residuals[rows], rows=rows)
    return replace(model, predictor=replace(predictor, correlation=some))


NAMES = ["correlation of some rows", "with tails", "fitted on supports", "with constant noise"]
NAMES += [*LEARNT, "analytical", "prior"]
NAMES += [f"{kind}, extended" for kind in (*LEARNT, "analytical", "prior")]


EVERY_MODEL = pytest.mark.parametrize("name", NAMES)


def answers(model: PushModel | TabulatedModel, rows: slice = slice(None)) -> Prediction:
    return model.predict_rows(INPUTS[rows], DURATION[rows], {name: column[rows] for name, column in COVARIATES.items()})


def assert_same_bits(one: Prediction, other: Prediction) -> None:
    for part in PARTS:
        assert np.array_equal(getattr(one, part), getattr(other, part)), part


@EVERY_MODEL
def test_a_model_and_its_table_predict_the_same_bits_after_saving_and_loading(
    models: dict[str, PushModel], tables: dict[str, TabulatedModel], name: str, tmp_path: Path
) -> None:
    model, table = models[name], tables[name]
    save_model(model, tmp_path / "m")
    loaded = load_model(tmp_path / "m")
    assert is_model_file(tmp_path / "m") and (loaded.kind, loaded.needs) == (model.kind, model.needs)
    assert_same_bits(answers(loaded), answers(model))
    assert (loaded.name, loaded.provenance) == (model.name, model.provenance)
    assert model_digest(loaded) == model_digest(model)
    if model.predictor.learnt:
        block = np.arange(len(model.training)) % 4
        for ours, theirs in zip(model.held_out_moments(block), loaded.held_out_moments(block), strict=True):
            assert np.array_equal(ours, theirs)
    if table.tabulated:
        write_tables(tmp_path / "tables", "digest", table)
        read = read_tables(tmp_path / "tables", "digest", loaded)
        assert read is not None
        assert_same_bits(answers(read), answers(table))


@EVERY_MODEL
def test_a_table_answers_as_its_model(
    models: dict[str, PushModel], tables: dict[str, TabulatedModel], name: str
) -> None:
    table = tables[name]
    assert table.tabulated == isinstance(models[name].predictor.base, GaussianProcessPredictor)
    found, exact = answers(table), answers(models[name])
    assert np.max(np.abs(found.mean - exact.mean) / exact.std) < MEAN_TOLERANCE
    for part in ("covariance", "process_covariance"):
        units = np.sqrt(np.diagonal(getattr(exact, part), axis1=1, axis2=2))
        ratios = (getattr(found, part) - getattr(exact, part)) / units[:, :, None] / units[:, None]
        np.testing.assert_allclose(ratios, 0.0, atol=COVARIANCE_TOLERANCE)
    assert np.array_equal(found.in_domain, exact.in_domain) and found.tails is exact.tails


@EVERY_MODEL
def test_a_push_alone_has_the_prediction_that_it_has_among_others(
    models: dict[str, PushModel], tables: dict[str, TabulatedModel], name: str
) -> None:
    """A positive definite one, also beyond the domain, with no more process noise than there is in all."""
    for served in (models[name], tables[name]):
        together = answers(served)
        for k in range(len(INPUTS)):
            alone = answers(served, slice(k, k + 1))
            np.testing.assert_allclose(alone.mean[0], together.mean[k], rtol=1e-8, atol=1e-12)
            for part in ("covariance", "process_covariance"):
                np.testing.assert_allclose(getattr(alone, part)[0], getattr(together, part)[k], rtol=1e-6, atol=1e-14)
            assert alone.in_domain[0] == together.in_domain[k]
        assert np.linalg.eigvalsh(together.covariance).min() > 0.0
        assert np.linalg.eigvalsh(together.covariance - together.process_covariance).min() > -1e-15
        none = answers(served, slice(0))
        assert [getattr(none, part).shape for part in PARTS] == [(0, 3), (0, 3, 3), (0, 3, 3), (0,)]


@pytest.mark.parametrize("name", [name for name in NAMES if not name.startswith("prior")])
def test_one_push_is_held_out_by_default(models: dict[str, PushModel], name: str) -> None:
    model, rows = models[name], models[name].training
    push = np.unique(rows.push_id, return_inverse=True)[1]
    for found, expected in zip(model.held_out_moments(), model.held_out_moments(push), strict=True):
        np.testing.assert_array_equal(found, expected)
    own = model.predict_rows(rows.inputs, rows.duration, rows.covariates).mean
    assert np.array_equal(model.held_out_moments().mean, own) == (not model.predictor.learnt)


def test_outputs_are_stored_only_where_they_do_not_follow(models: dict[str, PushModel], tmp_path: Path) -> None:
    for name, apart in (("gp about mechanics", False), ("vhgp", False), ("vhgp, extended", True)):
        save_model(models[name], tmp_path / "m")
        assert ("outputs" in read_archive(tmp_path / "m")[1]) == apart, name


def test_models_have_the_digest_of_what_they_predict(models: dict[str, PushModel]) -> None:
    digests = {model_digest(models[name]) for name in NAMES}
    assert len(digests) == len(NAMES)
    assert model_digest(replace(models["gp"], name="other")) == model_digest(models["gp"])


TO_DO = r"format version .* reads version 9 only: train the model again$"
OTHERS = [8, FORMAT_VERSION + 1, 0, True, float(FORMAT_VERSION), str(FORMAT_VERSION), None]


@pytest.mark.parametrize(("name", "value", "message"), [
    *(("format_version", version, TO_DO) for version in OTHERS),
    ("format", "push table", "format 'push table' is not accepted, give a 'push_predictor model'"),
])  # fmt: skip
def test_another_format_is_refused_with_what_to_do(
    models: dict[str, PushModel], name: str, value: object, message: str, tmp_path: Path
) -> None:
    with pytest.raises(ModelFileError, match=f"m: {message}"):
        load_changed(models["gp"], lambda record, _: record.update({name: value}), tmp_path / "m")


Change = Callable[[dict[str, Any], dict[str, np.ndarray]], object]
REGRESSION = "regressions.0"


def load_changed(model: PushModel, change: Change, path: Path) -> PushModel:
    save_model(model, path)
    record, arrays = read_archive(path)
    change(record, arrays)
    path.write_bytes(archived(record, arrays))
    return load_model(path)


def put(place: str, value: object) -> Change:
    """Sets what is at a place of the record: names and indices with points between."""

    def change(record: dict[str, Any], _: object) -> None:
        *path, last = place.split(".")
        found: Any = record
        for key in path:
            found = found[int(key) if isinstance(found, list) else key]
        found[int(last) if isinstance(found, list) else last] = value

    return change


EXTENDED, QUANTILES = "analytical, extended", "predictor.tails.quantiles"


def mark(stamp: int) -> dict[str, object]:
    return {"class": "Mark", "stamp": stamp, "pushes": 0.0, "slid": 0.0}


DAMAGES: list[tuple[str, Change, str]] = [
    ("vhgp", put("regressions.0.parameters.noise_log_lengthscales", [[0.0] * 3]), r"log_lengthscales: shape \(1, 3\)"),
    ("gp", put("predictor.class", "Popen"), "predictor: .*is not accepted, give an object of class Gaussian"),
    ("gp", put("predictor.class", "PushTable"), "predictor: .*is not accepted, give an object of class Gaussian"),
    ("gp", put("predictor.scaling.class", "Tails"), r"predictor\.scaling: .*give an object of class Scaling"),
    ("gp", put("predictor.scaling.surplus", 1), r"predictor\.scaling: .*give the fields columns"),
    ("gp", put("predictor.scaling.columns", [True]), r"predictor\.scaling\.columns\.0: 'True' .*give int"),
    ("gp", put("predictor.scaling.outcome_sd", "array"), r"predictor\.scaling\.outcome_sd: the array is missing"),
    ("gp", put("predictor.scaling.outcome_sd", ["a"] * 3), r"outcome_sd: .*give an array of float64"),
    ("gp", put("regressions.0.parameters.log_noise_sd", float("nan")), r"log_noise_sd: a number is not finite"),
    ("gp", put("regressions.0.parameters.log_noise_sd", "1"), r"parameters\.log_noise_sd: '1' .*give float"),
    ("gp", put("regressions.0.class", "VHGP"), r"regressions\.0: .*GaussianProcess or ConstantNoise"),
    ("gp", put("kind", "vhgp"), r"regressions\.0: .*VHGP or SparseVHGP"),
    ("gp", put("kind", "prior"), "GaussianProcessPredictor is not accepted for kind 'prior'"),
    ("gp", put("regressions", []), "regressions"),
    ("gp", lambda record, _: record["regressions"].pop(), "regressions"),
    ("gp", lambda _, arrays: arrays.update({"training.inputs": 1e9 * arrays["training.inputs"]}), "longer than 10 m"),
    ("gp", lambda _, arrays: arrays.update({"training.outcomes": arrays["training.outcomes"] * np.nan}), "not finite"),
    ("gp", lambda _, arrays: arrays.update(outputs=np.zeros((3, 3))), "outputs of shape"),
    (
        "vhgp, extended",
        lambda _, arrays: arrays.update(outputs=np.nan * arrays["outputs"]),
        r"regressions\.0\.outputs: a number is not finite",
    ),
    ("vhgp, extended", lambda _, arrays: arrays.update(outputs=arrays["outputs"].astype(str)), "outputs: .*of float64"),
    ("gp", put("correlation.bandwidth", 0.0), r"correlation\.bandwidth: numbers from"),
    ("gp", put("correlation.shrinkage", -1.0), r"correlation\.shrinkage: numbers from"),
    ("gp", put("correlation.rows", [0, 40]), "IndexError: index 40 is out of bounds"),
    ("gp", put("correlation.rows", [0, 1]), "ValueError: matmul"),
    ("gp", put("correlation.rows", [0, -1]), "rows: a number of a training row is negative"),
    ("vhgp", lambda _, a: a.update({f"{REGRESSION}.site_precisions": -np.ones(40)}), r"site_precisions: numbers from"),
    ("vhgp", lambda _, a: a.update({f"{REGRESSION}.site_precisions": np.ones(39)}), "ValueError: matmul"),
    ("sparse vhgp", put("regressions.0.parameters.log_lengthscales", [0.0]), r"log_lengthscales: shape \(1,\)"),
    ("sparse vhgp", put("regressions.0.inducing_signal", [3, 3]), "inducing_signal does not contain distinct"),
    ("sparse vhgp", put("regressions.0.inducing_noise", [-1]), "inducing_noise does not contain distinct"),
    ("sparse vhgp", put("regressions.0.inducing_noise", [40]), "IndexError: index 40 is out of bounds"),
    ("sparse vhgp", put("regressions.0.inducing_noise", [0.5]), "inducing_noise: .*give an array of int64"),
    ("gp about mechanics", put("predictor.scaling.travel", 0.0), r"predictor\.scaling\.travel: numbers from"),
    ("with constant noise", put("regressions.1.parameters.noise_spread", 11.0), "noise_spread: numbers from 0 to 10"),
    ("fitted on supports", put("predictor.fitted.values", [["warmth", 0.1]]), "'warmth' is no parameter"),
    ("fitted on supports", put("predictor.fitted.values.0.1", 9.0), "contact_friction 9, 9: 0.0 to 1.5 is accepted"),
    ("fitted on supports", put("predictor.fitted.covariance", [[1.0]]), r"predictor\.fitted: covariance of shape"),
    ("fitted on supports", put("predictor.fitted.mechanics.accuracy", 1e-9), r"mechanics\.accuracy: numbers from"),
    (
        "fitted on supports",
        put("predictor.fitted.mechanics.supports.0.1.points", [[9e9, 0.0]] + [[0.0, 0.0]] * 4),
        "large",
    ),
    ("fitted on supports", put("predictor.fitted.mechanics.supports.0.1.spread", -0.1), "far too large"),
    ("fitted on supports", lambda record, _: record["training"]["covariates"].pop(), "needs the covariate recording"),
    ("analytical", put("predictor.fitted.mechanics.support.length", 1e-9), "too close together"),
    ("analytical", put("predictor.fitted.mechanics.support.centre", [1.0]), r"support\.centre: shape \(1,\)"),
    ("analytical", put("predictor.fitted.mechanics.support.power", 1.0), r"support\.power: numbers from 1 to 100"),
    ("analytical", put("predictor.covariance", [[0.0] * 3] * 3), "covariance of a training push is not"),
    ("prior", put("predictor.noise.factor", [1.0, 0.0, 1.0]), r"predictor\.noise\.factor: numbers from"),
    (
        "prior",
        lambda _, arrays: arrays.update({"predictor.draws": np.full((64, 16), 9.0)}),
        "predictor: .* is accepted",
    ),
    ("prior", lambda _, arrays: arrays.update({"predictor.draws": np.zeros((1, 16))}), "2 to 10000 of 16 are needed"),
    ("prior", lambda _, arrays: arrays.update({"predictor.draws": np.zeros((4, 3))}), "2 to 10000 of 16 are needed"),
    (EXTENDED, put("predictor.scale", [1.0, 1.0]), r"predictor\.scale: shape \(2,\) is not accepted, give \(3,\)"),
    (EXTENDED, put("predictor.effects.1.mechanism", "os.system"), r"effects\.1: 'os.system'"),
    (EXTENDED, put("predictor.effects.1.coefficients", [0.1, 0.1]), r"effects\.1: 1 coefficients and their"),
    (EXTENDED, put("predictor.effects.1.covariance", [[-1.0]]), r"effects\.1: the covariance is not positive"),
    (EXTENDED, put("predictor.effects.1.outcome_scale", [1.0]), r"effects\.1\.outcome_scale: shape \(1,\)"),
    (EXTENDED, put("predictor.effects.1.basis.name", "eval"), "predictor.effects.1: 'eval'"),
    (EXTENDED, put("predictor.effects.1.basis.drivers", []), r"effects\.1\.basis: drivers \(\) are not accepted"),
    (EXTENDED, put("predictor.effects.1.basis.drivers", ["warmth"]), "needs the covariate warmth, which the"),
    (EXTENDED, put("predictor.effects.1.basis.scale", [0.0]), r"effects\.1\.basis: a scale is zero"),
    (EXTENDED, put("predictor.effects.1.basis.scale", []), r"effects\.1\.basis: centre and scale: 1 number"),
    (EXTENDED, put("predictor.cross.0.1", [[2e-8]]), "predictor: the covariance is not positive semidefinite"),
    (EXTENDED, put("predictor.cross.0.1", [[float("nan")]]), "predictor: the covariance is not positive semidefinite"),
    (EXTENDED, put("predictor.cross.0.1", [[0.0, 0.0]]), r"cross 0, 1 of shape \(1, 2\)"),
    (EXTENDED, put("predictor.cross.0.0", [1, 1]), "cross 1, 1 of shape"),
    (EXTENDED, put("predictor.cross.0.0", [0, 3]), "cross 0, 3 of shape"),
    (EXTENDED, lambda record, _: record["predictor"].pop("session"), "train the model again"),
    (EXTENDED, put("predictor.session.now", [["warmth", 1.0]]), "'warmth' is no cumulative covariate"),
    (EXTENDED, put("predictor.session.now", [["push_index", math.inf]]), "not finite"),
    (EXTENDED, put("predictor.session.marks", [mark(2), mark(1)]), "decrease"),
    (EXTENDED, put("predictor.session.origin", 2**63), "64 bits"),
    ("with tails", put("predictor.tails.scale", [0.0, 1.0, 1.0]), r"tails\.scale: numbers from"),
    ("with tails", put("predictor.tails.degrees", [2.0, 3.0, 3.0]), r"tails\.degrees: numbers from 2"),
    ("with tails", put("predictor.tails.joint_scale", 0.0), r"tails\.joint_scale: numbers from"),
    ("with tails", put("predictor.tails.joint_degrees", 2.0), r"tails\.joint_degrees: numbers from 2"),
    ("with tails", put("predictor.tails.pushes", 0), r"tails\.pushes: numbers from 1"),
    ("with tails", put("predictor.tails.quantiles", [[1.0] * 3]), r"tails\.quantiles: shape \(1, 3\)"),
    # Intervals would be far too narrow, and no prediction shows it.
    ("with tails", lambda _, arrays: arrays.update({QUANTILES: arrays[QUANTILES][::-1]}), "tails: quantiles decrease"),
]


@pytest.mark.parametrize(("name", "change", "message"), DAMAGES, ids=[f"{k}-{d[0]}" for k, d in enumerate(DAMAGES)])
def test_what_no_model_has_is_refused_and_named(
    models: dict[str, PushModel], name: str, change: Change, message: str, tmp_path: Path
) -> None:
    with pytest.raises(ModelFileError, match=rf"m: the model file is damaged \(.*{message}") as caught:
        load_changed(models[name], change, tmp_path / "m")
    assert "\n" not in str(caught.value)


NONSENSE = ([[0]], "array", "1e9", math.nan, 10**400, {"class": "Popen"})  # null and [] may be a lack


def places(part: Any, *path: Any) -> Iterator[tuple[Any, ...]]:
    """The paths of keys and indices to all that a record contains."""
    for key, value in part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ():
        yield (*path, key)
        yield from places(value, *path, key)


# The file of an extended model contains that of its base.
@pytest.mark.parametrize("name", [name for name in NAMES if f"{name}, extended" not in NAMES])
def test_nonsense_anywhere_in_a_file_is_refused_or_changes_no_prediction(
    models: dict[str, PushModel], name: str, tmp_path: Path
) -> None:
    """At some places of the record, and in each array: not finite, too short, with another shape, not numbers."""
    save_model(models[name], tmp_path / "m")
    record, arrays = read_archive(tmp_path / "m")
    expected, rng = answers(models[name]), np.random.default_rng(NAMES.index(name))
    every = list(places(record))
    changed = []
    for place in rng.permutation(len(every))[:12]:
        damaged = copy.deepcopy(record)
        put(".".join(map(str, every[place])), NONSENSE[rng.integers(len(NONSENSE))])(damaged, arrays)
        changed.append((damaged, arrays))
    wrong = (lambda a: a * np.nan, lambda a: a[:-1], lambda a: a[None], lambda a: a.astype(str))
    for key, array in arrays.items():
        if array.dtype.kind == "f" and key != "predictor.draws":  # of which fewer are accepted
            changed.append((record, {**arrays, key: wrong[rng.integers(len(wrong))](array)}))
    for damaged, with_arrays in changed:
        (tmp_path / "m").write_bytes(archived(damaged, with_arrays))
        with suppress(ModelFileError):
            assert_same_bits(answers(load_model(tmp_path / "m")), expected)


@dataclass(frozen=True)
class Unknown:
    """A class that is not in the table."""

    value: float


def test_only_the_classes_of_the_table_are_written_and_read() -> None:
    with pytest.raises(TypeError, match="x: Unknown is no class of a model file"):
        encode(Unknown(1.0), "x", {})
    with pytest.raises(ValueError, match=r"x: .*is not accepted"):
        Reader({}).read({"class": "Unknown", "value": 1.0}, Unknown, "x")


def test_all_that_is_not_stored_is_an_argument_of_its_class() -> None:
    """A field with another name would be written, and a table entry without effect would remain."""
    for cls, name in GIVEN:
        assert cls in CLASSES.values() and name in cls.__init__.__code__.co_varnames


def test_numbers_keep_their_bits_and_arrays_their_shapes() -> None:
    values = {"a": np.array([[0.1 + 0.2, 1e-300]]), "b": np.zeros((0, 3)), "c": np.arange(100.0)[::-1]}
    arrays: dict[str, np.ndarray] = {}
    record = json.loads(json.dumps(encode(values, "x", arrays)))
    assert sorted(arrays) == ["x.1.1", "x.2.1"]
    found = Reader(arrays).read(record, dict[str, Array], "x")
    for name, value in values.items():
        assert found[name].dtype == np.float64 and np.array_equal(found[name], value)
        assert found[name].shape == value.shape


def test_a_prior_of_few_draws_is_read(models: dict[str, PushModel], tmp_path: Path) -> None:
    model = models["prior"]
    assert isinstance(model.predictor, PriorPredictor)
    few = replace(model, predictor=replace(model.predictor, draws=model.predictor.draws[:2]))
    save_model(few, tmp_path / "m")
    loaded = load_model(tmp_path / "m").predictor
    assert isinstance(loaded, PriorPredictor) and np.array_equal(loaded.draws, model.predictor.draws[:2])

"""A model extended by effects: what it predicts, what it asks for, the file it lives in, and how effects are sized."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ros_harness as harness
from synthetic import square_rig, translating_push

from msg_adapters.predictions import PushQuery, prediction_from_response, query_to_batch_request, query_to_request
from push_predictor.cli import main
from push_predictor.errors import ModelFileError, RequestError
from push_predictor.evaluation.validation import compare, metrics_json
from push_predictor.models.analytical import AnalyticalPush
from push_predictor.models.effects import Effect, design_of
from push_predictor.models.forms import Form
from push_predictor.models.mechanisms import Push
from push_predictor.models.model_file import load_model, save_model
from push_predictor.models.push_model import KINDS, ExtendedBody, Prediction, PushModel
from push_predictor.models.request import check_request, check_table
from push_predictor.models.served import serve
from push_predictor.models.train import train_model
from push_predictor.nodes.model_shelf import ModelShelf
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import write_table
from push_predictor.recordings.write import write_recording
from push_predictor.residuals.extension import extend, gain, refit_base
from push_predictor_interfaces.srv import ListModels, PredictPush, PredictPushBatch

NOISE = np.array([1e-4, 1e-4, 3e-3])
DRIFT = Form("linear", ("elapsed_time",), (500.0,), (300.0,))
WARMTH = Form("linear", ("topic:/warmth",), (0.0,), (1.0,))
GRAIN = ("anisotropic_friction", "push_heading", Form("constant"))
FIELDS = ("mean", "covariance", "process_covariance", "in_domain")


def physics() -> AnalyticalPush:
    rig = square_rig()
    return AnalyticalPush(rig.outline, rig.pusher_radius)


def pushes(count: int = 100, seed: int = 0, *effects: Effect) -> PushTable:
    """Pushes of three windows, by the analytical model with these effects; the windows of a push share some noise."""
    rng = np.random.default_rng(seed)
    n = 3 * count
    inputs = np.column_stack([np.full(n, 0.02), rng.random(n), rng.uniform(-0.9, 0.9, n)])
    duration = np.full(n, 0.2)
    shared = np.repeat(rng.standard_normal((count, 3)), 3, axis=0)
    outcomes = physics().displacement(inputs, duration) + NOISE * (0.5 * shared + rng.standard_normal((n, 3)))
    covariates = {
        "elapsed_time": np.repeat(np.linspace(0.0, 1000.0, count), 3),
        "topic:/warmth": np.repeat(rng.standard_normal(count), 3),
        "slider_heading": rng.uniform(-np.pi, np.pi, n),
    }
    shift = sum((e.shift(physics(), Push(inputs, duration, covariates))[0] for e in effects), np.zeros((n, 3)))
    push_id = np.array([f"{seed}-{k // 3}" for k in range(n)])
    return PushTable(inputs, duration, outcomes + shift, push_id, covariates)


def slippery(size: float, sd: float = 0.0) -> Effect:
    """A contact friction that changes by `size` in 300 s."""
    return Effect("contact_friction", "elapsed_time", DRIFT, np.array([size]), np.array([[sd**2]]), np.ones(3))


def grain(size: float) -> Effect:
    return Effect(*GRAIN, np.array([size, 0.5 * size]), np.diag([1e-4, 1e-4]), np.ones(3))


def extended(base: PushModel, *effects: Effect, scale: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> PushModel:
    return replace(base, body=ExtendedBody(base.body, physics(), effects, np.array(scale)))


@pytest.fixture(scope="module")
def bases() -> dict[str, PushModel]:
    return {kind: train_model(pushes(40), square_rig(), kind, name=f"a_{kind}") for kind in KINDS}


def predicted(model: Any, table: PushTable) -> Prediction:
    return model.predict(table.inputs, table.duration, table.covariates)


def assert_same(one: Prediction, other: Prediction, **precision: float) -> None:
    for name in FIELDS:
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), **(precision or {"rtol": 0.0}))


# --- what it predicts -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_an_effect_of_size_zero_changes_nothing(bases: dict[str, PushModel], kind: str) -> None:
    base, table = bases[kind], pushes(20, 1)
    nothing = extended(base, slippery(0.0), grain(0.0).__class__(*GRAIN, np.zeros(2), np.zeros((2, 2)), np.ones(3)))
    assert_same(predicted(nothing, table), predicted(base, table))
    assert_same(predicted(serve(nothing), table), predicted(serve(base), table))
    exact, own = nothing.exact_log_density(table), base.exact_log_density(table)
    assert (exact is None) == (own is None) == (kind != "vhgp")
    if exact is not None and own is not None:
        np.testing.assert_allclose(exact, own, rtol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_effects_shift_the_mean_and_add_what_they_are_unsure_of(bases: dict[str, PushModel], kind: str) -> None:
    base, table, effects = bases[kind], pushes(20, 1), (slippery(0.1, sd=0.05), grain(0.1))
    model, push = extended(base, *effects, scale=(0.5, 1.0, 2.0)), Push(table.inputs, table.duration, table.covariates)
    ours, theirs = predicted(model, table), predicted(base, table)
    shifts, unsure = zip(*(effect.shift(physics(), push) for effect in effects), strict=True)
    scale = np.diag([0.5, 1.0, 2.0])
    np.testing.assert_allclose(ours.mean, theirs.mean + sum(shifts), rtol=1e-12)
    np.testing.assert_allclose(ours.covariance, scale @ theirs.covariance @ scale + sum(unsure), atol=1e-18)
    np.testing.assert_allclose(ours.process_covariance, scale @ theirs.process_covariance @ scale, atol=1e-18)


def test_the_exact_density_is_that_of_the_base_where_the_effect_has_moved_it(bases: dict[str, PushModel]) -> None:
    base, table, effect = bases["vhgp"], pushes(20, 1), slippery(0.2)
    shift, _ = effect.shift(physics(), Push(table.inputs, table.duration, table.covariates))
    moved = extended(base, effect).exact_log_density(replace(table, outcomes=table.outcomes + shift))
    np.testing.assert_allclose(moved, base.exact_log_density(table), rtol=1e-9)


def test_the_exact_density_has_the_variance_that_is_predicted(bases: dict[str, PushModel]) -> None:
    model, one = extended(bases["vhgp"], slippery(0.2, sd=0.3), scale=(0.5, 1.0, 2.0)), pushes(3, 1).take([0])
    prediction = predicted(model, one)
    sd = np.sqrt(np.diagonal(prediction.covariance[0]))
    steps = np.linspace(-12.0, 12.0, 4001)
    rows = one.take(np.zeros(len(steps), dtype=int))
    density = np.exp(model.exact_log_density(replace(rows, outcomes=prediction.mean + steps[:, None] * sd)))
    weights = density * sd * (steps[1] - steps[0])
    np.testing.assert_allclose(weights.sum(axis=0), 1.0, rtol=1e-6)
    np.testing.assert_allclose((weights * steps[:, None] ** 2).sum(axis=0), 1.0, rtol=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_a_served_model_answers_one_push_as_it_answers_many(bases: dict[str, PushModel], kind: str) -> None:
    model, table = extended(bases[kind], slippery(0.2, sd=0.1), grain(0.1)), pushes(5, 1)
    served = serve(model)
    assert served.tabulated == (kind != "analytical")
    among = predicted(served, table)
    for k in range(len(table)):
        alone = predicted(served, table.take([k]))
        for name in FIELDS:
            np.testing.assert_allclose(getattr(alone, name)[0], getattr(among, name)[k], rtol=1e-7, atol=1e-12)
    sd = np.sqrt(np.diagonal(among.covariance, axis1=1, axis2=2))
    assert np.max(np.abs(among.mean - predicted(model, table).mean) / sd) < 1e-3


# --- what it asks for -------------------------------------------------------------------------------------------


def test_it_needs_what_drives_its_effects_and_what_their_mechanisms_take(bases: dict[str, PushModel]) -> None:
    assert bases["gp"].needs == ()
    assert extended(bases["gp"], slippery(0.1), grain(0.1), slippery(0.2)).needs == ("elapsed_time", "slider_heading")


@pytest.mark.parametrize(
    ("brought", "message"),
    [
        ({}, "covariate elapsed_time: 'missing' is not accepted, give a finite number, in s"),
        ({"elapsed_time": np.nan}, "covariate elapsed_time: nan is not accepted, give a finite number, in s"),
        ({"elapsed_time": 1.0, "other": np.inf}, "covariate other: inf is not accepted, give a finite number"),
    ],
)
def test_a_request_without_what_it_needs_is_refused_by_name(
    bases: dict[str, PushModel], brought: dict[str, float], message: str
) -> None:
    with pytest.raises(RequestError, match=message):
        check_request(extended(bases["gp"], slippery(0.1)), 0.02, 0.1, 0.2, 0.2, brought)


def test_what_it_does_not_need_is_no_matter(bases: dict[str, PushModel]) -> None:
    check_request(extended(bases["gp"], slippery(0.1)), 0.02, 0.1, 0.2, 0.2, {"elapsed_time": 1.0, "other": 2.0})
    table = pushes(5, 1)
    table.covariates["topic:/warmth"][:] = np.nan
    check_table(extended(bases["gp"], slippery(0.1)), table)


def test_a_table_without_what_it_needs_is_refused_by_name(bases: dict[str, PushModel]) -> None:
    with pytest.raises(RequestError, match="covariate elapsed_time: 'missing'"):
        check_table(extended(bases["gp"], slippery(0.1)), replace(pushes(5, 1), covariates={}))


# --- its file ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_keeps_it(bases: dict[str, PushModel], kind: str, tmp_path: Path) -> None:
    generic = Effect(None, "topic:/warmth", WARMTH, np.full(18, 0.1), 1e-4 * np.eye(18), NOISE / 0.004)
    trained = extend(bases[kind], pushes(40, 2, slippery(0.2)), [("contact_friction", "elapsed_time", DRIFT), GRAIN])
    body = trained.body
    assert isinstance(body, ExtendedBody)
    model = replace(trained, body=replace(body, effects=(*body.effects, generic), scale=np.array([0.9, 1.0, 1.1])))
    save_model(model, tmp_path / "m")
    loaded, table = load_model(tmp_path / "m"), pushes(10, 3)
    assert (loaded.kind, loaded.needs) == (kind, ("elapsed_time", "slider_heading", "topic:/warmth"))
    assert_same(predicted(loaded, table), predicted(model, table), rtol=1e-9, atol=1e-15)
    np.testing.assert_array_equal(loaded.training.outcomes, model.training.outcomes)
    loaded_json, ours = metrics_json(compare(loaded, table)), metrics_json(compare(model, table))
    assert loaded_json["nlpd"] == pytest.approx(ours["nlpd"], rel=1e-9)


def test_only_a_reader_that_knows_effects_takes_the_file(bases: dict[str, PushModel], tmp_path: Path) -> None:
    for name, model, version in (("base", bases["gp"], 1), ("more", extended(bases["gp"], slippery(0.1)), 3)):
        save_model(model, tmp_path / name)
        assert _header(tmp_path / name)["format_version"] == version


def _header(path: Path) -> dict[str, Any]:
    with np.load(path) as archive:
        return dict(json.loads(archive["header"].tobytes()))


DAMAGES: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "mechanism": (lambda e: e.update(mechanism="os.system"), "effect 1: mechanism 'os.system' is not in the library"),
    "form": (lambda e: e["form"].update(name="eval"), "effect 1: form 'eval', known are constant, linear"),
    "drivers": (lambda e: e["form"].update(drivers=[]), r"effect 1: form 'linear' with drivers \(\)"),
    "scale": (lambda e: e["form"].update(scale=[0.0]), "effect 1: form 'linear' with a scale of zero"),
    "number": (lambda e: e.update(coefficients=[float("nan")]), r"effect 1: coefficients \[nan\], 1 finite numbers"),
    "size": (lambda e: e.update(coefficients=[1.0, 2.0]), r"effect 1: coefficients \[1.0, 2.0\], 1 finite numbers"),
    "absent": (lambda e: e.pop("outcome_scale"), "effect 1: 'outcome_scale'"),
    "driver": (lambda e: e["form"].update(drivers=["moon"]), "covariate moon, which the training rows do not hold"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_effect_is_refused_by_name(bases: dict[str, PushModel], damage: str, tmp_path: Path) -> None:
    harm, message = DAMAGES[damage]
    save_model(extended(bases["analytical"], grain(0.1), slippery(0.1)), tmp_path / "m")
    with np.load(tmp_path / "m") as archive:
        arrays = {name: archive[name] for name in archive.files}
    header = json.loads(arrays["header"].tobytes())
    harm(header["body"]["effects"][1])
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    with (tmp_path / "m").open("wb") as stream:
        np.savez(stream, **arrays)
    with pytest.raises(ModelFileError, match=message):
        load_model(tmp_path / "m")


# --- its making -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["gp", "analytical"])
def test_planted_effects_are_found_within_their_intervals(bases: dict[str, PushModel], kind: str) -> None:
    terms = [("contact_friction", "elapsed_time", DRIFT), GRAIN]
    away = []
    for seed in range(10, 16):
        table = pushes(100, seed, slippery(0.15), grain(0.1))
        body = extend(refit_base(bases[kind], table), table, terms).body
        assert isinstance(body, ExtendedBody)
        found = np.concatenate([effect.coefficients for effect in body.effects])
        sd = np.concatenate([np.sqrt(np.diag(effect.covariance)) for effect in body.effects])
        away.append((found - [0.15, 0.1, 0.05]) / sd)
    # In units of their own deviations: Student's t with 25 blocks, its root mean square known to 0.2 here.
    assert 0.6 < np.sqrt(np.mean(np.square(away))) < 1.5
    assert np.max(np.abs(away)) < 4.0
    assert np.max(np.abs(np.mean(away, axis=0))) < 1.3  # not one-sided: 3 deviations of a mean of six
    assert np.all(sd < [0.05, 0.05, 0.05])


def test_two_terms_that_overlap_share_what_they_explain(bases: dict[str, PushModel]) -> None:
    table = pushes(100, 4, slippery(0.2))
    alike = Form("quadratic", ("elapsed_time",), (500.0,), (300.0,))
    terms = [("contact_friction", "elapsed_time", DRIFT), ("contact_friction", "elapsed_time", alike)]
    body = extend(refit_base(bases["analytical"], table), table, terms).body
    assert isinstance(body, ExtendedBody)
    push = Push(table.inputs, table.duration, table.covariates)
    shift, _ = body.shift(push)
    planted, _ = slippery(0.2).shift(physics(), push)
    assert np.sum((shift - planted) ** 2) < 0.2 * np.sum(planted**2)


@pytest.mark.parametrize("kind", ["gp", "analytical"])
def test_an_effect_that_is_there_gains_on_held_out_pushes(bases: dict[str, PushModel], kind: str) -> None:
    table, held_out = pushes(100, 5, slippery(0.2)), pushes(60, 6, slippery(0.2))
    refit = refit_base(bases[kind], table)
    after = extend(refit, table, [("contact_friction", "elapsed_time", DRIFT)])
    nmse, nlpd = gain(refit, after, held_out, bases[kind].training_mean)
    assert nmse.low < nmse.value < nmse.high < 0.0
    assert nlpd.low < nlpd.value < nlpd.high < 0.0
    coverage = metrics_json(compare(after, held_out))["coverage"]
    assert all(0.88 < share <= 1.0 for share in coverage["0.95"].values())


@pytest.mark.parametrize("kind", ["gp", "analytical"])
def test_an_effect_that_is_not_there_gains_nothing(bases: dict[str, PushModel], kind: str) -> None:
    table, held_out = pushes(100, 7), pushes(60, 8)
    refit = refit_base(bases[kind], table)
    after = extend(refit, table, [("contact_friction", "elapsed_time", DRIFT)])
    _, nlpd = gain(refit, after, held_out)
    assert abs(nlpd.value) < 0.05
    assert nlpd.high > 0.0


def test_a_refit_keeps_the_physics_and_learns_the_covariance(bases: dict[str, PushModel]) -> None:
    base, table = bases["analytical"], pushes(60, 9)
    loud = replace(table, outcomes=table.outcomes + 5.0 * NOISE * np.random.default_rng(0).standard_normal((180, 3)))
    refit = refit_base(base, loud)
    probe = pushes(3, 1)
    np.testing.assert_array_equal(predicted(refit, probe).mean, predicted(base, probe).mean)
    assert np.all(np.diagonal(predicted(refit, probe).covariance[0] / predicted(base, probe).covariance[0]) > 9.0)


@pytest.mark.parametrize("kind", ["gp", "analytical"])
def test_a_refit_of_an_extended_model_keeps_its_effects(bases: dict[str, PushModel], kind: str) -> None:
    table, held_out = pushes(60, 10, slippery(0.3)), pushes(30, 11, slippery(0.3))
    model = extended(bases[kind], slippery(0.3))
    refit = refit_base(model, table)
    assert isinstance(refit.body, ExtendedBody) and isinstance(model.body, ExtendedBody)
    assert refit.body.effects == model.body.effects
    plain = refit_base(bases[kind], table)
    assert gain(plain, refit, held_out)[1].high < 0.0
    more = extend(refit, table, [GRAIN])
    assert isinstance(more.body, ExtendedBody)
    assert [effect.mechanism for effect in more.body.effects] == ["contact_friction", "anisotropic_friction"]
    assert np.all(np.abs(more.body.effects[1].coefficients) < 0.1)


def test_what_drives_an_unknown_mechanism_is_modelled_by_the_generic_one(bases: dict[str, PushModel]) -> None:
    table, held_out = pushes(150, 12, slippery(0.3)), pushes(60, 13, slippery(0.3))
    refit = refit_base(bases["analytical"], table)
    after = extend(refit, table, [(None, "elapsed_time", DRIFT)])
    assert gain(refit, after, held_out)[1].high < 0.0
    design = design_of(None, DRIFT, physics(), Push(table.inputs, table.duration, table.covariates), np.ones(3))
    assert isinstance(after.body, ExtendedBody)
    assert after.body.effects[0].coefficients.shape == (design.shape[2],)


# --- the command line, the shelf, the service -------------------------------------------------------------------


@pytest.fixture(scope="module")
def model_file(bases: dict[str, PushModel], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("extended") / "extended.model"
    save_model(replace(extended(bases["gp"], slippery(0.2, sd=0.1)), name="extended"), path)
    return path


def test_predict_takes_the_covariate_and_asks_for_it(model_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    push = ["predict", str(model_file), "--velocity", "0.02", "--contact", "0.1", "--angle", "-0.8"]
    assert main(push) != 0
    assert "covariate elapsed_time: 'missing' is not accepted, give a finite number, in s" in capsys.readouterr().err
    means = []
    for time in ("0", "1000"):
        assert main([*push, "--covariate", f"elapsed_time={time}", "--json", "-"]) == 0
        means.append(json.loads(capsys.readouterr().out)["mean"])
    assert means[0] != means[1]


def test_evaluate_names_the_column_that_a_table_lacks(
    model_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_table(tmp_path / "whole.csv", pushes(10, 1))
    write_table(tmp_path / "lacking.csv", replace(pushes(10, 1), covariates={}))
    assert main(["evaluate", str(model_file), str(tmp_path / "whole.csv"), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["n_test"] == 30
    assert main(["evaluate", str(model_file), str(tmp_path / "lacking.csv")]) == 1
    assert "covariate elapsed_time" in capsys.readouterr().err


@pytest.mark.parametrize("driver", ["elapsed_time", "topic:/warmth"])
def test_validate_takes_from_the_windows_what_it_needs_or_names_it(
    bases: dict[str, PushModel], driver: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    effect = replace(slippery(0.2), form=replace(DRIFT, drivers=(driver,)))
    save_model(extended(bases["gp"], effect), tmp_path / "m")
    write_recording(tmp_path / "bag", translating_push())
    status = main(["validate", str(tmp_path / "m"), str(tmp_path / "bag"), "--json", "-"])
    heard = capsys.readouterr()
    if driver == "elapsed_time":
        assert (status, json.loads(heard.out)["n_test"]) == (0, 5)
    else:
        assert status == 1
        assert "covariate topic:/warmth: 'missing' is not accepted" in heard.err


def test_the_shelf_lists_what_a_request_must_bring(model_file: Path) -> None:
    shelf = ModelShelf()
    shelf.load(model_file)
    assert "covariates=elapsed_time;" in shelf.describe("extended")


@pytest.fixture(scope="module")
def ask(model_file: Path) -> Iterator[Callable[..., Any]]:
    """Calls a service of a running predict_server that serves the extended model."""
    domain, kinds = (
        harness.free_domain(),
        {"predict_push": PredictPush, "predict_push_batch": PredictPushBatch, "list_models": ListModels},
    )
    params = {"models": [str(model_file)]}
    with contextlib.ExitStack() as stack:
        stack.enter_context(harness.node_process("predict_server", domain=domain, params=params))
        node = stack.enter_context(harness.ros_context(domain))
        clients = {name: node.create_client(kind, name) for name, kind in kinds.items()}
        yield lambda name, request: harness.call(clients[name], request)


def test_the_service_refuses_a_push_without_the_covariate_by_name(ask: Callable[..., Any]) -> None:
    response = ask("predict_push", query_to_request("", np.array([0.02, 0.1, 0.2]), 0.2))
    assert not response.success
    assert response.message.startswith("covariate elapsed_time: 'missing' is not accepted, give a finite number, in s")
    batch = ask("predict_push_batch", query_to_batch_request(PushQuery("", np.array([[0.02, 0.1, 0.2]]), 0.2, {})))
    assert (batch.success, "covariate elapsed_time" in batch.message) == (False, True)


def test_the_service_answers_with_the_covariate(ask: Callable[..., Any], model_file: Path) -> None:
    table = pushes(10, 1)
    time = {"elapsed_time": table.covariates["elapsed_time"]}
    expected = serve(load_model(model_file)).predict(table.inputs, table.duration, time)
    batch = ask("predict_push_batch", query_to_batch_request(PushQuery("", table.inputs, 0.2, time)))
    assert_same(prediction_from_response(batch), expected, rtol=1e-9, atol=1e-15)
    first = {name: float(column[0]) for name, column in time.items()}
    one = ask("predict_push", query_to_request("", table.inputs[0], 0.2, first))
    np.testing.assert_allclose(prediction_from_response(one).mean[0], expected.mean[0], rtol=1e-7)
    assert "covariates=elapsed_time;" in ask("list_models", ListModels.Request()).descriptions[0]

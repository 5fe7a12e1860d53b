# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The Python interface: what `from push_predictor import ...` gives, from data to a choice."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import threadpoolctl
from lab_bags import short_recording
from repository import BAGS, REPOSITORY

import push_predictor
from push_predictor import (
    Goal,
    Pushes,
    PushModel,
    choose_push,
    find_windows,
    load_model,
    read_recording,
    trace,
    train,
    validate,
)
from push_predictor.cli import main
from push_predictor.errors import PushPredictorError, RequestError, RigError
from push_predictor.planning.rollout import rollout
from push_predictor.recordings.rig import save_rig
from push_predictor.recordings.table_file import write_table
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.recordings.write import write_recording

TRAINING = BAGS / "square_abs_test"
FEW = BAGS / "hexagon_delrin"  # 53 windows


@pytest.fixture(scope="module")
def model() -> PushModel:
    return train(str(TRAINING), kind="gp", mean="zero", n_train=100, name="small", watch=lambda stage, done: None)


def test_importing_the_package_imports_neither_numpy_nor_anything_of_its_own():
    code = (
        "import sys, push_predictor\n"
        "heavy = [m for m in sys.modules if m in ('numpy', 'scipy') or m.startswith('push_predictor.')]\n"
        "sys.exit(', '.join(heavy) or 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=REPOSITORY)


def test_every_public_name_is_there_and_documented_and_others_are_refused():
    for name in push_predictor.__all__:
        assert getattr(push_predictor, name).__doc__, name
        assert name in dir(push_predictor)
    with pytest.raises(AttributeError, match="'push_predictor' has no attribute 'predcit'"):
        push_predictor.predcit  # noqa: B018 (reading it is the test)


# --- training ---------------------------------------------------------------------------------------------------------


@dataclass
class Training:
    """A model of few windows, each stage of its training with its share, and the BLAS threads during and around it."""

    model: PushModel
    seen: list[tuple[str, float]]
    threads: tuple[list[int], set[int], list[int]]


@pytest.fixture(scope="module")
def few() -> Training:
    seen: list[tuple[str, float]] = []
    during: set[int] = set()

    def watch(stage: str, done: float) -> None:
        seen.append((stage, done))
        if stage.startswith("train "):
            during.update(blas_threads())

    with threadpoolctl.threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        model = train([FEW], kind="gp", n_train=25, watch=watch)
        return Training(model, seen, (before, during, blas_threads()))


@pytest.mark.slow
def test_training_reports_each_stage_with_its_share_of_the_work(few: Training):
    stages = [stage for stage, _ in few.seen]
    assert [any(output in stage for stage in stages) for output in ("dx", "dy", "dtheta")] == [True] * 3
    shares = [done for _, done in few.seen]
    assert shares == sorted(shares) and shares[-1] == 1.0


@pytest.mark.slow
def test_the_seed_draws_the_training_windows():
    one, same, other = (train(FEW, kind="analytical", n_train=20, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.training.outcomes, same.training.outcomes)
    assert not np.array_equal(one.training.outcomes, other.training.outcomes)
    assert (one.provenance.seed, other.provenance.seed) == (1, 2)


def test_without_a_callback_training_prints_its_progress_to_stderr(capsys: pytest.CaptureFixture[str]):
    train(FEW, kind="analytical", n_train=40)
    captured = capsys.readouterr()
    assert "read the data" in captured.err and "100 %" in captured.err and not captured.out


@pytest.mark.slow
def test_training_uses_one_blas_thread_and_leaves_the_callers_setting_alone(few: Training):
    before, during, after = few.threads
    assert during == {1} and before == after and 2 in before


LEARNT = "push_predictor.models.predictors.gaussian_process_predictor.GaussianProcessPredictor"


def blas_threads() -> list[int]:
    return [pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("step", "call"),
    [
        ("push_predictor.models.store.model_file.read_archive", lambda model: load_model("resource/none.pushmodel")),
        ("push_predictor.api.validate_recording", lambda model: validate(model, FEW)),
        (
            "push_predictor.api.model_repertoire",
            lambda model: choose_push(model, [0.0, 0.0, 0.0], Goal([0.03, 0.0, 0.0], 0.01, None)),
        ),
        ("push_predictor.residuals.trace.window_options", lambda model: trace(model, FEW)),
        (f"{LEARNT}.moments", lambda model: model.predict(Pushes(0.02, 0.1, 0.3))),
        (f"{LEARNT}.held_out_moments", lambda model: model.held_out_moments()),
        (f"{LEARNT}.exact_log_density", lambda model: model.exact_log_density(model.training)),
        (
            "push_predictor.planning.rollout.persistence_of",
            lambda model: rollout(model, np.zeros(3), np.zeros((3, 3)), np.array([[0.02, 0.1, 0.0, 0.2]])),
        ),
    ],
)
def test_every_long_step_uses_one_blas_thread(model: PushModel, monkeypatch: pytest.MonkeyPatch, step: str, call: Any):
    during: list[int] = []

    def reached(*arguments: object) -> None:
        during.extend(blas_threads())
        raise PushPredictorError("reached")

    monkeypatch.setattr(step, reached)
    with threadpoolctl.threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        with pytest.raises(PushPredictorError, match="reached"):
            call(replace(model, name="fresh"))
        assert set(during) == {1} and blas_threads() == before


def test_a_prediction_without_large_matrices_is_not_slowed_down(monkeypatch: pytest.MonkeyPatch):
    computed = train(FEW, kind="analytical")
    during: list[int] = []
    exact = type(computed.predictor).moments

    def moments(*arguments: Any) -> Any:
        during.extend(blas_threads())
        return exact(*arguments)

    monkeypatch.setattr(type(computed.predictor), "moments", moments)
    with threadpoolctl.threadpool_limits(limits=2, user_api="blas"):
        computed.predict(Pushes(0.02, 0.1, 0.3))
    assert set(during) == {2}


@pytest.mark.slow
def test_the_name_is_the_first_files_stem_and_the_provenance_names_the_data(model: PushModel, tmp_path: Path):
    table, rig = windows_to_table(find_windows(read_recording(FEW))).take(np.arange(50)), model.rig
    write_table(tmp_path / "monday.csv.gz", table)
    learned = train(tmp_path / "monday.csv.gz", kind="analytical", rig=rig)
    assert learned.name == "monday" and learned.provenance.sources == ("monday.csv.gz",)


@pytest.mark.slow
def test_a_rig_may_be_an_object_a_path_or_left_to_the_data(model: PushModel, tmp_path: Path):
    table = windows_to_table(find_windows(read_recording(FEW))).take(np.arange(40))
    write_table(tmp_path / "rows.csv", table)
    with pytest.raises(RigError, match="push_rig"):
        train(tmp_path / "rows.csv", kind="analytical")
    save_rig(model.rig, tmp_path / "a.yaml")
    for rig in (model.rig, tmp_path / "a.yaml", str(tmp_path / "a.yaml")):
        assert train(tmp_path / "rows.csv", kind="analytical", rig=rig).rig.pusher_radius == model.rig.pusher_radius


# --- models and predictions -------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_saved_model_predicts_the_same_and_paths_are_str_or_path(model: PushModel, tmp_path: Path):
    model.save(str(tmp_path / "m.pushmodel"))
    pushes = Pushes(0.02, [0.1, 0.4], 0.3)
    for path in (tmp_path / "m.pushmodel", str(tmp_path / "m.pushmodel")):
        np.testing.assert_array_equal(load_model(path).predict(pushes).mean, model.predict(pushes).mean)


@pytest.mark.slow
def test_the_repr_of_a_prediction_fits_one_screen_and_marks_pushes_out_of_domain(model: PushModel):
    few = repr(model.predict(Pushes([0.02, 0.5], 0.1, 0.3)))
    assert "yes" in few.splitlines()[2] and "NO" in few.splitlines()[3]
    mean = model.predict(Pushes([0.02, 0.5], 0.1, 0.3)).mean[0]
    assert f"{1e3 * mean[0]:.3f} ±" in few
    many = repr(model.predict(Pushes(np.linspace(0.01, 0.05, 500), 0.1, 0.3)))
    assert len(many.splitlines()) < 20 and "... and 490 more" in many


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pushes", "message"),
    [
        (Pushes(-0.02, 0.1, 0.3), "velocity: -0.02 is not accepted, give a finite number above 0, in m/s"),
        (Pushes(0.02, [0.1, 0.2, 1.5], 0.3, duration=[0.2, 0.19, 0.19]), r"contact\[2\]: 1.5"),  # of all durations
    ],
)
def test_a_push_that_the_model_cannot_predict_is_refused_as_a_service_would(
    model: PushModel, pushes: Pushes, message: str
):
    with pytest.raises(RequestError, match=message):
        model.predict(pushes)


# --- windows, validation, trace ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_windows_are_found_from_the_recorded_rig_end_to_end_or_overlapping():
    recording = read_recording(str(FEW))
    plain, dense = find_windows(recording), find_windows(recording, stride=0.05)
    assert {round(w.duration, 9) for w in plain} == {0.2} and len(dense) > 2 * len(plain)


@pytest.mark.parametrize("given", [{"duration": 0.0}, {"duration": np.nan}, {"stride": -0.1}])
def test_a_wrong_duration_or_stride_is_refused(given):
    with pytest.raises(RequestError, match=next(iter(given))):
        find_windows(read_recording(FEW), **given)


def flat(tree: Any) -> list[float]:
    """The numbers of nested dicts, in order."""
    return [number for value in tree.values() for number in flat(value)] if isinstance(tree, dict) else [tree]


@pytest.mark.slow
def test_a_validation_has_the_metrics_of_the_command_line(
    few: Training, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    model = few.model
    model.save(tmp_path / "m.pushmodel")
    with pytest.warns(push_predictor.DataWarning, match="pushes were used for training"):
        found = validate(model, str(FEW))
    assert main(["validate", str(tmp_path / "m.pushmodel"), str(FEW), "--json", "-"]) == 0
    printed = json.loads(capsys.readouterr().out)
    for key in ("nmse", "nlpd", "coverage"):
        np.testing.assert_allclose(flat(found.metrics[key]), flat(printed[key]), rtol=1e-9)
    assert (found.metrics["n_test"], found.metrics["n_pushes"]) == (printed["n_test"], printed["n_pushes"])
    assert len(found.windows) == printed["n_test"] and "53 windows of 10 pushes" in repr(found)


@pytest.mark.slow
def test_a_trace_reports_its_stages_and_tries_the_covariates_that_were_asked_for(model: PushModel, tmp_path: Path):
    seen: list[str] = []
    write_table(tmp_path / "earlier.csv", model.training)
    model = train(tmp_path / "earlier.csv", kind="analytical", rig=model.rig, watch=lambda stage, done: None)
    write_recording(tmp_path / "later", short_recording(50.0))
    found = trace(
        model, tmp_path / "later", alpha=0.05, covariates=["elapsed_time"], watch=lambda stage, done: seen.append(stage)
    )
    assert "motion" in seen and found.alpha == 0.05 and found.model is model
    tried = {each.covariate for each in found.tested if each.mechanism == "contact_friction"}
    assert "elapsed_time" in tried and "slider_x" not in tried
    assert repr(found).startswith(f"Trace of 'earlier': {found.verdict} (")
    assert found.gain_nlpd.low <= found.gain_nlpd.value <= found.gain_nlpd.high


# --- the next push ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_chosen_push_moves_the_slider_towards_the_goal_and_at_the_goal_there_is_none(model: PushModel):
    goal = Goal([0.03, 0.0, 0.0], 0.01, None)
    choice = choose_push(model, [0.0, 0.0, 0.0], goal)
    assert choice is not None
    assert np.hypot(*(choice.mean[:2] - goal.pose[:2])) < 0.03
    assert "probability" in repr(choice) and len(repr(choice).splitlines()) == 3
    assert choose_push(model, (0.03, 0.0, 0.0), goal) is None
    with pytest.raises(RequestError, match="slider"):
        choose_push(model, [0.0, 0.0], goal)

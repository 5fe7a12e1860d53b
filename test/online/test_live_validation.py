# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Scores while windows and predictions arrive: the same as for a whole table, in little memory."""

from __future__ import annotations

import json
import random
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_windows import made_up_windows, predict
from synthetic import square_rig

from push_predictor.evaluation.offline import rig_difference
from push_predictor.evaluation.validation import Comparison, compare, metrics_json
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.predictors.tails import STEPS, Tails
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.online.live_validation import LiveValidation, RunningScore, WindowRows, write_window_log
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.push_window import PushWindow, windows_to_table


@pytest.fixture(scope="module")
def models() -> dict[str, PushModel]:
    table = windows_to_table(made_up_windows(40, seed=1))
    return {
        kind: train_model(table, square_rig(), kind, name=kind, options=TrainingOptions(mean="zero"))
        for kind in ("gp", "analytical")
    }


def answered(models: dict[str, PushModel], windows: list[PushWindow], shuffle: int = 0) -> LiveValidation:
    """All windows, and every model's prediction of each in a random order."""
    live = LiveValidation(models)
    numbers = [live.add(window) for window in windows]
    jobs = [(k, number) for number in numbers for k in range(len(models))]
    random.Random(shuffle).shuffle(jobs)
    for k, number in jobs:
        live.record(k, number, predict(live.models[k], windows[number]))
    return live


def same_window(a: PushWindow, b: PushWindow) -> bool:
    arrays = ("displacement", "slider_start", "slider_end")
    others = {key: value for key, value in vars(a).items() if key not in arrays}
    return others == {key: vars(b)[key] for key in others} and all(
        np.array_equal(getattr(a, name), getattr(b, name)) for name in arrays
    )


def test_a_push_is_complete_when_the_main_model_has_answered_and_another_has_begun(
    models: dict[str, PushModel],
) -> None:
    live, windows = LiveValidation(models), made_up_windows(5)

    def add(name: str, count: int) -> list[int]:
        return [live.add(replace(windows[0], push_id=name)) for _ in range(count)]

    def predicted(*numbers: int) -> None:
        for number in numbers:
            live.record(0, number, predict(live.models[0], live.windows[number]))

    def completed(last: bool = False) -> list[tuple[str, int]]:
        """Name and number of windows of each push."""
        pushes = live.completed(last)
        assert all(push.mean.shape == (len(push.windows), 3) and push.end == windows[0].end for push in pushes)
        return [(push.windows.push_id[0], len(push.windows)) for push in pushes]

    predicted(*add("a", 2))
    assert completed() == [], "it may go on"
    first, second = add("b", 2)
    predicted(first)
    assert completed() == [("a", 2)]
    (only,) = add("c", 1)
    assert completed() == [], "a window of b has no answer yet"
    live.refuse(1, second, "another model")
    assert completed() == []
    live.refuse(0, second, "angle: 2.0 is not accepted")
    assert completed() == [("b", 1)], "it was refused"
    predicted(only)
    assert completed(last=True) == [("c", 1)]
    add("d", 1)
    assert completed(last=True) == [], "never answered"


# --- memory --------------------------------------------------------------------------------------------------------


def test_rows_return_the_windows_that_were_appended():
    windows, rows = made_up_windows(20), WindowRows()
    for window in windows:
        rows.append(window)
    assert len(rows) == 20 and all(map(same_window, rows, windows))
    assert same_window(rows[-1], windows[-1])
    assert [w.start for w in rows.take([5, 2])] == [windows[5].start, windows[2].start]
    assert [w.start for w in rows[3:6]] == [w.start for w in windows[3:6]]
    with pytest.raises(IndexError):
        rows[20]


def test_a_predicted_window_takes_less_than_700_bytes(models: dict[str, PushModel]):
    """A day of pushing without a break, 432 000 windows, then takes less than 300 MB."""
    windows = made_up_windows(1000)
    prediction = predict(models["gp"], windows[0])
    live = LiveValidation({"gp": models["gp"]})
    tracemalloc.start()
    for window in windows:
        live.record(0, live.add(window), prediction)
    taken = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert taken / len(windows) < 700


# --- the running score -----------------------------------------------------------------------------------------------


TAILS = Tails(np.ones(3), np.array([2.2, 4.0, 9.0]), 1.0, 5.0, 20, np.zeros((STEPS, 3)))


@given(seed=st.integers(0, 1000), count=st.integers(1, 30), tails=st.sampled_from([None, TAILS]))
@settings(max_examples=30, deadline=None)
def test_running_sums_give_the_totals_of_the_final_metrics(seed: int, count: int, tails: Tails | None):
    rng = np.random.default_rng(seed)
    mean, observed, training_mean = rng.normal(size=(count, 3)), rng.normal(size=(count, 3)), rng.normal(size=3)
    root = rng.normal(size=(count, 3, 3))
    covariance = root @ root.transpose(0, 2, 1) + 0.1 * np.eye(3)
    push_id = np.array([f"p{k // 3}" for k in range(count)])
    score = RunningScore(training_mean, tails)
    for row in zip(push_id.tolist(), mean, covariance, observed, strict=True):
        score.add(*row)
    final = metrics_json(Comparison("m", 1, push_id, mean, covariance, observed, None, training_mean, tails))
    running = score.values()
    assert (running["windows"], running["pushes"]) == (final["n_test"], final["n_pushes"])
    assert running["nmse"] == pytest.approx(final["nmse"]["total"], rel=1e-12)
    assert running["nlpd"] == pytest.approx(final["nlpd"]["total"], rel=1e-12)
    for level, shares in final["coverage"].items():
        for output, share in shares.items():
            assert running[f"coverage {level} {output}"] == pytest.approx(share, abs=1e-12)


def test_scores_are_none_before_the_first_window():
    values = RunningScore(np.zeros(3)).values()
    assert values.pop("windows") == values.pop("pushes") == 0
    assert set(values.values()) == {None}


# --- online as offline -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shuffle", [0, 1])
def test_predictions_in_any_order_give_the_comparison_of_the_table(models: dict[str, PushModel], shuffle: int):
    windows = made_up_windows(12)
    live = answered(models, windows, shuffle)
    for k, model in enumerate(models.values()):
        offline, online = compare(model, windows_to_table(windows)), live.comparison(k)
        assert np.array_equal(online.push_id, offline.push_id)
        assert np.array_equal(online.observed, offline.observed)
        assert np.allclose(online.mean, offline.mean, rtol=0.0, atol=1e-12)
        assert np.allclose(online.covariance, offline.covariance, rtol=1e-9, atol=0.0)


def test_residuals_are_ordered_by_window_and_model(models: dict[str, PushModel]):
    windows = made_up_windows(5)
    found = [(each.model, each.window.start) for each in answered(models, windows, shuffle=3).residuals()]
    assert found == [(name, window.start) for window in windows for name in models]


def test_residuals_keep_whether_the_push_was_in_the_domain(models: dict[str, PushModel]):
    windows, live = made_up_windows(3), LiveValidation(models)
    for inside, window in zip((True, False, True), windows, strict=True):
        prediction = predict(live.models[0], window)
        live.record(0, live.add(window), replace(prediction, in_domain=np.array([inside])))
    assert [each.in_domain for each in live.residuals()] == [True, False, True]
    assert [each.window.start for each in live.residuals()] == [window.start for window in windows]


def test_windows_without_a_prediction_are_counted_and_not_scored(models: dict[str, PushModel], tmp_path: Path):
    windows = made_up_windows(9)
    live = LiveValidation(models)
    for window in windows:
        live.add(window)
    for number in (8, 0, 4):
        live.record(0, number, predict(live.models[0], windows[number]))
    live.refuse(0, 3, "angle: 2.0 is not accepted")
    assert [w.start for w in live.predicted()] == [windows[k].start for k in (0, 4, 8)]
    assert metrics_json(live.comparison())["n_test"] == live.scores[0].windows == 3
    assert live.unanswered() == 5 and live.unanswered(1) == 9
    live.write(tmp_path)
    log = json.loads((tmp_path / "windows.json").read_text())
    assert log["refused"] == [{"push_id": "push-0", "window": 3, "reason": "angle: 2.0 is not accepted"}]
    assert log["unanswered"] == 5 and len(log["windows"]) == 3


# --- files -----------------------------------------------------------------------------------------------------------


def test_writes_files_for_the_main_model_and_the_others(models: dict[str, PushModel], tmp_path: Path):
    windows = made_up_windows(8)
    live = answered(models, windows)
    written = live.write(tmp_path / "new" / "folder")
    assert [path.name for path in written] == ["validation.json", "validation_analytical.json"]
    for k, path in enumerate(written):
        assert json.loads(path.read_text()) == json.loads(json.dumps(metrics_json(live.comparison(k))))
    log = json.loads((tmp_path / "new" / "folder" / "windows_analytical.json").read_text())
    assert log["model"] == "analytical" and log["refused"] == [] and log["unanswered"] == 0
    assert [(w["push_id"], w["window"]) for w in log["windows"]] == [(w.push_id, w.index) for w in windows]
    first, comparison = log["windows"][0], live.comparison(1)
    assert first["predicted"] == comparison.mean[0].tolist()
    assert first["observed"] == windows[0].displacement.tolist()
    assert (first["start"], first["end"]) == (windows[0].start, windows[0].end)
    difference = comparison.observed[0] - comparison.mean[0]
    root = np.linalg.cholesky(np.reshape(first["covariance"], (3, 3)))
    assert np.allclose(root @ first["standardised"], difference)
    assert not [path for path in (tmp_path / "new" / "folder").iterdir() if path.name.startswith(".")]


def test_a_run_without_windows_is_written_with_empty_scores(models: dict[str, PushModel], tmp_path: Path):
    (path, _) = LiveValidation(models).write(tmp_path)
    result = json.loads(path.read_text())
    assert (result["n_test"], result["n_pushes"], result["nmse"]["total"], result["nlpd"]["dx"]) == (0, 0, None, None)
    assert json.loads((tmp_path / "windows.json").read_text())["windows"] == []


def test_model_names_cannot_leave_the_output_folder(models: dict[str, PushModel], tmp_path: Path):
    named = {"main": models["gp"], "../../etc/x y": models["analytical"]}
    written = LiveValidation(named).write(tmp_path / "out")
    assert written[1].parent == tmp_path / "out" and written[1].name == "validation_.._.._etc_x_y.json"
    assert {path.parent for path in tmp_path.rglob("*.json")} == {tmp_path / "out"}


def test_a_failed_log_keeps_the_older_one(models: dict[str, PushModel], tmp_path: Path):
    windows = made_up_windows(3)
    comparison = compare(models["gp"], windows_to_table(windows))
    write_window_log(tmp_path / "log.json", windows, comparison)
    older = (tmp_path / "log.json").read_text()
    comparison.observed[1, 0] = np.nan
    with pytest.raises(ValueError, match="JSON"):
        write_window_log(tmp_path / "log.json", windows, comparison)
    assert (tmp_path / "log.json").read_text() == older
    assert [path.name for path in tmp_path.iterdir()] == ["log.json"]


# --- model and rig ---------------------------------------------------------------------------------------------------


def test_detects_a_model_of_another_slider_or_pusher(models: dict[str, PushModel]):
    own = square_rig()
    assert rig_difference(models["gp"], own) == ""
    assert rig_difference(models["gp"], Rig("rect1", own.outline, own.pusher_radius, "abs", 2.0)) == ""
    circle = Rig("ellip1", shape_outline("ellip1"), own.pusher_radius, "abs", 0.8)
    assert "'rect1'" in rig_difference(models["gp"], circle) and "'ellip1'" in rig_difference(models["gp"], circle)
    thick = rig_difference(models["gp"], Rig("rect1", own.outline, 0.01, "abs", 0.8))
    assert "0.00475" in thick and "0.01" in thick


def test_a_report_compares_the_models_that_predicted_the_windows_of_the_main_one(models: dict[str, PushModel]) -> None:
    windows = made_up_windows(6, seed=2)
    live = answered(models, windows)
    assert [model.kind for model in live.reported()[0]] == ["gp", "analytical"]
    number = live.add(windows[0])
    live.record(0, number, predict(live.models[0], windows[0]))
    live.refuse(1, number, "the covariate is missing")
    kinds, shown, comparisons = live.reported()
    assert [model.kind for model in kinds] == ["gp"] and len(shown) == len(comparisons[0].observed) == 7

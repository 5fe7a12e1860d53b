# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The whole chain on pushes measured by others: import, replay through the nodes, windows, validation.

Figures of these data with their intervals: docs/results/accuracy.md. Eight long pushes show that the chain is right
(frames, contact, signs, online equals offline); they are too few to rank models.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hosted_nodes import hosted_node
from ros_harness import free_domain, wait_until
from synthetic import Push, pose_stream, stamps, translating_push, windows_of
from validator_bench import hosting_replay, hosting_validator

from benchmarks.models.accuracy import compared, model_of
from benchmarks.models.cases import runs_in_turn
from push_predictor.evaluation.estimate import Figure, total_nlpd, total_nmse
from push_predictor.evaluation.metrics import nmse
from push_predictor.evaluation.offline import validate_recording
from push_predictor.evaluation.push_scores import pooled, push_scores
from push_predictor.evaluation.validation import Comparison, compare, metrics_json
from push_predictor.models.mechanics.fitted import analytical_mechanics
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.online.live_validation import window_log
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.streams import Recording, WrenchStream
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions

RUNS = [f"{block}_block_metal_{run}" for block in ("Al", "St") for run in (1, 2, 3, 4)]
BAG = "Test_metal_1"  # aluminium run 1 as a ROS 1 bag
HEXAGON = "motion_surface=plywood_shape=hex_a=0_v=150_i=1.000_s=0.000_t=-0.349"
RATE = 10.0


@pytest.fixture(scope="module")
def imported(measured_data: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Every recording of mcube_preliminary and mit_raw as MCAP, by name."""
    out = tmp_path_factory.mktemp("imported")
    sources = [("mcube", measured_data / "mcube_preliminary"), ("mit", measured_data / "mit_raw")]
    written = [path for kind, source in sources for path in import_source(kind, [source], out / kind).written]
    return {path.name: path for path in written}


@pytest.fixture(scope="module")
def found(imported: dict[str, Path]) -> dict[str, list[PushWindow]]:
    """Their windows."""
    recordings = {name: read_recording(path) for name, path in imported.items()}
    return {name: find_windows(recording, require_rig(recording)) for name, recording in recordings.items()}


def block_runs(imported: dict[str, Path], block: str) -> list[Path]:
    return [imported[name] for name in RUNS if name.startswith(block)]


# --- the windows of the long pushes -----------------------------------------------------------------------------


@pytest.mark.parametrize("run", RUNS)
def test_the_windows_of_a_long_push_tile_it_from_first_touch(found: dict[str, list[PushWindow]], run: str) -> None:
    windows = found[run]
    assert len({window.push_id for window in windows}) == 1
    assert gapless(windows), "no break of a lasting contact"
    gaps = [window.covariates["contact_gap"] for window in windows]
    assert abs(np.median(gaps)) < 0.6e-3, "tip and tracker agree but for jitter of some ms at 130 mm/s"
    assert abs(gaps[0]) < WindowOptions().touch_gap


@pytest.mark.parametrize("run", RUNS)
def test_the_windows_of_a_long_push_add_up_to_what_the_rig_did(
    imported: dict[str, Path], found: dict[str, list[PushWindow]], run: str
) -> None:
    recording, windows = read_recording(imported[run]), found[run]
    moved = np.array([window.displacement for window in windows])
    way, turn = np.hypot(*moved[:, :2].T).sum(), moved[:, 2].sum()
    tip, ends = recording.pusher, [windows[0].start, windows[-1].end]
    chord = np.hypot(*(np.diff(np.interp(ends, tip.stamp, column))[0] for column in (tip.x, tip.y)))
    assert 0.11 < chord / (1e-9 * (ends[1] - ends[0])) < 0.15
    assert 0.16 < way < 0.40
    slider = recording.slider
    whole = float(np.unwrap(slider.heading)[-1] - slider.heading[0])
    # What is missing is the stretch of less than a window before contact is lost.
    assert np.degrees(abs(whole)) > 60.0 and 0.8 < turn / whole < 1.02
    chord = np.hypot(slider.x[-1] - slider.x[0], slider.y[-1] - slider.y[0])
    assert np.hypot(*(windows[-1].slider_end - windows[0].slider_start)[:2]) == pytest.approx(chord, rel=0.05)


# --- models of the long pushes ----------------------------------------------------------------------------------


@pytest.mark.parametrize("block", ["Al", "St"])
def test_textbook_physics_explains_the_long_pushes_and_no_mirror_of_them(imported: dict[str, Path], block: str) -> None:
    runs = block_runs(imported, block)
    table, rig = load_data(runs), load_rig_for(runs)
    physics = analytical_mechanics(rig.outline, rig.pusher_radius)

    def score(angle: int, dtheta: int) -> float:
        predicted = physics.displacement(table.inputs * [1, 1, angle], table.duration) * [1, 1, dtheta]
        return float(nmse(predicted, table.outcomes, table.outcomes.mean(axis=0)).sum())

    assert score(1, 1) < 0.4
    assert min(score(1, -1), score(-1, 1), score(-1, -1)) > 1.0


def leave_one_run_out(runs: list[Path], kind: str) -> list[Comparison]:
    """Each run predicted by a model of the others."""
    return [compared(case, case.training, kind) for case in runs_in_turn(runs)]


def total(figure: Figure, *found: Comparison) -> float:
    """NMSE or NLPD of these runs together."""
    return float(figure(pooled([push_scores(comparison) for comparison in found]).totals())[0])


def test_learnt_from_other_runs_a_model_predicts_an_aluminium_run(imported: dict[str, Path]) -> None:
    """Plain models of the raw outcomes, about no mechanics: these runs turn both ways, and a VHGP alone learns it."""
    runs = block_runs(imported, "Al")
    learnt, physics = (leave_one_run_out(runs, kind) for kind in ("vhgp-plain", "textbook"))
    assert total(total_nmse, *learnt) < 0.15 and total(total_nmse, *physics) < 0.15
    assert total(total_nlpd, *learnt) < total(total_nlpd, *physics)


def test_a_run_that_turns_as_no_other_lies_outside_the_learnt_domain(imported: dict[str, Path]) -> None:
    """Steel run 3 alone turns clockwise: what a plain model learnt from the others fails there, and says so."""
    cases = runs_in_turn(block_runs(imported, "St"))
    models = [model_of(case, case.training, "vhgp-plain") for case in cases]
    asked = [(case.test.inputs, case.test.duration, case.test.covariates) for case in cases]
    inside = [model.predict_rows(*rows).in_domain.mean() for model, rows in zip(models, asked, strict=True)]
    scores = [total(total_nmse, compare(model, case.test)) for model, case in zip(models, cases, strict=True)]
    assert [share < 0.5 for share in inside] == [False, False, True, False]
    assert scores[2] > 1.0 > 0.3 > max(scores[:2] + scores[3:])


def test_a_default_model_predicts_even_the_run_that_turns_as_no_other(imported: dict[str, Path]) -> None:
    """It is learnt about mechanics, which know both directions of turning, and better than textbook mechanics."""
    runs = block_runs(imported, "St")
    learnt, textbook = (leave_one_run_out(runs, kind) for kind in ("vhgp", "textbook"))
    assert max(total(total_nmse, run) for run in learnt) < 0.3
    assert total(total_nmse, *learnt) < total(total_nmse, *textbook)
    assert total(total_nlpd, *learnt) < total(total_nlpd, *textbook)


# --- through the real nodes -------------------------------------------------------------------------------------


Served = tuple[int, dict[str, PushModel]]


@pytest.fixture(scope="module")
def served(
    request: pytest.FixtureRequest, imported: dict[str, Path], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Served]:
    """The ROS domain in which a predict_server serves the models of a slider, and these models by name.

    Of a block from runs 1 to 3, of the hexagon from its own push.
    """
    slider, kinds = request.param
    runs = [imported[HEXAGON]] if slider == "hex" else block_runs(imported, slider)[:3]
    table = load_data(runs, None, WindowOptions(stride=0.01 if slider == "hex" else None))
    rig, folder, domain = load_rig_for(runs), tmp_path_factory.mktemp("models"), free_domain()
    models = {
        f"{slider}_{kind}": train_model(table, rig, kind, name=f"{slider}_{kind}", options=TrainingOptions(mean="zero"))
        for kind in kinds
    }
    for name, model in models.items():
        save_model(model, folder / f"{name}.pushmodel")
    with hosted_node("predict_server", domain=domain, params={"models": [str(folder)]}) as node:
        node.wait_for_text("active with the models", 120.0)
        yield domain, models


def validated_online(recording: Path, names: list[str], domain: int, out: Path) -> None:
    """Replay a recording to a validator of its own, which leaves its files in `out`."""
    watching = {"model": names[0], "compare": names[1:] or [""], "output": out, "report": False}
    with (
        hosting_validator(domain=domain, params=watching) as validator,
        hosting_replay(domain, recording=recording, rate=RATE) as replay,
    ):
        assert wait_until(lambda: "Validation written" in validator.text(), 120.0), validator.text() + replay.text()
        replay.wait_for_text("lost 0")  # it says so after its last message


# Of each block a run that its models were not trained on, or that turns as no other; a ROS 1 bag; a single window.
AL, ST, HEX = ("Al", ("vhgp", "analytical")), ("St", ("vhgp", "gp", "analytical")), ("hex", ("analytical",))
LONG = [
    pytest.param(slider, run, marks=pytest.mark.long)
    for slider, run in ((AL, BAG), (ST, "St_block_metal_3"), (HEX, HEXAGON))
]


@pytest.mark.parametrize(("served", "run"), [(AL, "Al_block_metal_4"), *LONG], indirect=["served"])
def test_online_validation_of_a_measured_push_equals_offline(
    measured_data: Path, imported: dict[str, Path], served: Served, tmp_path: Path, run: str
) -> None:
    if run == BAG:
        pytest.importorskip("rosbags")
        source = measured_data / "mcube_preliminary" / "Al_block" / f"{BAG}.bag"
        (recording,) = import_source("rosbag1", [source], tmp_path / "bag").written
    else:
        recording = imported[run]
    domain, models = served
    names = list(models)
    validated_online(recording, names, domain, tmp_path)
    for name in names:
        suffix = "" if name == names[0] else f"_{name}"
        online = json.loads((tmp_path / f"windows{suffix}.json").read_text())
        windows, comparison = validate_recording(models[name], recording)
        assert online["refused"] == [] and online["unanswered"] == 0
        for ours, theirs in zip(window_log(windows, comparison), online["windows"], strict=True):
            assert all(ours[key] == theirs[key] for key in ("push_id", "window", "start", "end"))
            for key in ("velocity", "contact", "angle", "observed", "predicted", "covariance"):
                np.testing.assert_allclose(theirs[key], ours[key], rtol=1e-9, atol=1e-12)
        score = json.loads((tmp_path / f"validation{suffix}.json").read_text())
        offline = metrics_json(comparison)
        assert score["n_test"] == offline["n_test"] == len(windows)
        if len(windows) > 1:
            assert score["nmse"] == pytest.approx(offline["nmse"], rel=1e-9)
            assert score["nlpd"] == pytest.approx(offline["nlpd"], rel=1e-9)


# --- the one push of the hexagon --------------------------------------------------------------------------------


def test_the_hexagons_push_is_found_as_its_file_name_states(found: dict[str, list[PushWindow]]) -> None:
    (window,) = found[HEXAGON]
    assert window.angle == pytest.approx(-0.349, abs=0.02), "t in the file's name"
    assert window.covariates["edge"] == 1.0, "i, the side"
    assert (window.contact - 1.0 / 6.0) * 6.0 == pytest.approx(0.0, abs=0.02), "s, the position on the side"
    assert 0.10 < window.velocity < 0.16, "v is 0.150; the tip sets off from rest in contact"


# --- contact of a tip that begins near the slider, as all of these recordings do ----------------------------------


def beginning_near(still: float = 0.5, preload: float = 0.0) -> Recording:
    """The tip rests for `still` s at 2 mm from the slider, drives, and touches; a bias of the sensor of 1 N throughout.

    In the middle of the push the tracker sees it up to 2 mm off. preload: force (N) on the resting tip.
    """
    recording = translating_push(Push(begin=0.1, end=2.0), tail=0.3)
    slider, tip, wrench = recording.slider, recording.pusher, recording.wrench
    assert wrench is not None
    time = np.arange(0.0, still + 2.295, 0.01)
    driven = np.maximum(time - still, 0.0) / 0.01

    def drawn_out(values: np.ndarray) -> np.ndarray:
        return np.interp(driven, np.arange(len(values)), values)

    off = np.interp(time - still, [0.6, 0.9, 1.1, 1.4], [0.0, 0.002, 0.002, 0.0])
    resting = preload * (time < still)
    return replace(
        recording,
        slider=pose_stream(time, np.column_stack([drawn_out(slider.x), drawn_out(slider.y)]), np.zeros_like(time)),
        pusher=pose_stream(time, np.column_stack([drawn_out(tip.x) - off, drawn_out(tip.y)]), np.zeros_like(time)),
        wrench=WrenchStream(stamps(time), drawn_out(wrench.fx) - resting, drawn_out(wrench.fy) + 1.0, 0.0 * time),
    )


def gapless(windows: list[PushWindow]) -> bool:
    return all(a.end == b.start for a, b in itertools.pairwise(windows))


def test_the_force_keeps_a_contact_that_the_tracker_sees_open() -> None:
    """The tip was never free, so the sensor's zero is known from its rest alone."""
    pushed = beginning_near()
    assert len(windows_of(pushed)) == 9 and gapless(windows_of(pushed))  # 1.9 s of contact
    assert not gapless(windows_of(replace(pushed, wrench=None)))


def test_a_preload_on_the_resting_tip_hides_no_contact() -> None:
    """It may be pressed at rest as hard as the push will be: geometry still tells that it touches."""
    pressed, blind = beginning_near(preload=2.0), replace(beginning_near(), wrench=None)
    with_force, without = windows_of(pressed), windows_of(blind)
    assert with_force[0].start == without[0].start and len(with_force) >= len(without)


def test_the_force_begins_no_contact_before_the_tip_was_free() -> None:
    recording = beginning_near()
    assert recording.wrench is not None
    early = np.arange(len(recording.wrench.stamp)) > 50  # as a robot's acceleration presses on the sensor
    shaken = replace(recording, wrench=replace(recording.wrench, fx=recording.wrench.fx - 0.5 * early))
    assert windows_of(shaken)[0].start == windows_of(recording)[0].start

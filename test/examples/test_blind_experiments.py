# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The benchmark of proposed pushes: what it counts, and that it continues the recording with the same effect."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.blind import experiments
from benchmarks.blind.effects import TEMPERATURE
from benchmarks.blind.experiments import (
    FAILED,
    SETTLED_RIGHT,
    SETTLED_WRONG,
    UNDECIDED,
    continuation,
    main,
    markdown_of,
    outcome_of,
    proposed_spec,
    random_spec,
    undecided_of,
)
from benchmarks.blind.recordings import Size, conditions, drawn_recording, make_one
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.simulation.spec import SimulationSpec, start_poses

SMALL = Size(training=25, least=20, most=24, rows=40, kind="analytical")
TRUTH = {
    "group": "library", "channel": "motion", "kind": "contact_friction", "names": ["contact_friction"],
    "covariates": ["elapsed_time"], "size": "large",
}  # fmt: skip


def verdict(covariate: str, *rivals: str, **other: Any) -> dict[str, Any]:
    return {
        "verdict": "effect", "effect_present": True, "channel": "motion", "kind": "mean", "covariates": [covariate],
        "equivalent": list(rivals), "undecided": bool(rivals), "motion_model_changed": True, "experiment": [],
        "effects": [{"mechanism": "contact_friction", "covariate": covariate}],
        "gain": {"nlpd": {"value": -0.4, "low": -0.5, "high": -0.3}}, **other,
    }  # fmt: skip


def nothing_found() -> dict[str, Any]:
    return verdict("", verdict="none", effect_present=False, channel="none", covariates=[], effects=[])


@pytest.mark.parametrize(
    ("result", "outcome"),
    [
        (verdict("elapsed_time"), SETTLED_RIGHT),
        (verdict("push_index"), SETTLED_WRONG),
        (verdict("elapsed_time", "push_index"), UNDECIDED),
        (nothing_found(), SETTLED_WRONG),
        ({"failed": "RecordingError: no push"}, FAILED),
    ],
)
def test_outcome_of_a_verdict(result: dict[str, Any], outcome: str) -> None:
    assert outcome_of(TRUTH, result) == outcome


def test_only_undecided_effects_on_the_mean_of_the_motion_are_continued(tmp_path: Path) -> None:
    measured, noise = verdict("a", "b", channel="measurement"), verdict("a", "b", kind="variance")
    every = (verdict("a", "b"), verdict("a"), {"failed": "x"}, measured, noise)
    for name, result in zip(("000", "001", "002", "003", "004"), every, strict=True):
        (tmp_path / f"{name}.json").write_text(json.dumps(result))
    assert undecided_of(tmp_path) == ["000"]


def test_table_counts_both_arms_with_intervals() -> None:
    def one(proposed: str, random: str, pushes: int = 20) -> dict[str, Any]:
        arms = {"proposed": (proposed, pushes), "random": (random, 20)}
        return {
            "rivals": ["a", "b", "c"],
            **{arm: {"outcome": o, "pushes": n, "rivals": ["a"]} for arm, (o, n) in arms.items()},
        }

    text = markdown_of([one(SETTLED_RIGHT, UNDECIDED)] * 3 + [one(UNDECIDED, SETTLED_WRONG, pushes=0)])
    assert "| proposed | 3 | 0 | 1 | 0 | 3 of 4 (30 to 95 %) |" in text
    assert "| random | 0 | 1 | 3 | 0 | 0 of 4 (0 to 49 %) |" in text
    assert "3.00 before, 1.00 with proposed pushes, 1.00 with random pushes" in text
    assert "Nothing was proposed for 1 of 4" in text


@pytest.fixture(scope="module")
def later() -> SimulationSpec:
    return drawn_recording(0, "none", 3, SMALL)[1]


def proposals(**columns: list[float]) -> list[dict[str, float]]:
    n = len(next(iter(columns.values())))
    own = {"velocity": [0.02] * n, "contact": [0.1, 0.6, 0.9][:n], "angle": [0.0] * n, "slider_heading": [1.0] * n}
    return [{name: values[k] for name, values in {**own, **columns}.items()} for k in range(n)]


def test_proposed_values_are_set(later: SimulationSpec) -> None:
    end, n = float(conditions(later).values["elapsed_time"][-1]), len(later.pushes)
    wanted = proposals(
        elapsed_time=[end + 500.0, end + 520.0, end + 521.0], slider_x=[0.1, -0.1, 0.0], travel=[0.03, 0.04, 0.05]
    )
    spec = proposed_spec(later, wanted, np.random.default_rng(0))
    assert spec is not None
    values = conditions(spec).values
    assert values["elapsed_time"][n : n + 2] == pytest.approx([end + 500.0, end + 520.0])
    assert values["elapsed_time"][n + 2] >= end + 521.0
    assert values["slider_x"][n:].tolist() == [0.1, -0.1, 0.0] and values["slider_heading"][n:].tolist() == [1.0] * 3
    assert spec.pushes.travel[n:].tolist() == [0.03, 0.04, 0.05]
    assert np.array_equal(start_poses(spec)[:n], start_poses(later))
    for name, column in conditions(later).values.items():
        assert np.array_equal(values[name][:n], column), name


def test_topic_has_the_proposed_value_at_each_push(later: SimulationSpec) -> None:
    n = len(later.pushes)
    spec = proposed_spec(later, proposals(**{f"topic:/{TEMPERATURE}": [18.0, 27.0, 18.0]}), np.random.default_rng(0))
    assert spec is not None
    assert conditions(spec).values[TEMPERATURE][n:] == pytest.approx([18.0, 27.0, 18.0])
    more = continuation(later, spec, 10**18)
    assert more.rig is not None
    found = find_windows(more, more.rig)
    seen = [window.covariates[f"topic:{TEMPERATURE}"] for window in found]
    assert {round(value) for value in seen} == {18, 27}


def test_dwell_time_is_waited_for(later: SimulationSpec) -> None:
    spec = proposed_spec(later, proposals(dwell_time=[30.0, 2.0, 9.0]), np.random.default_rng(0))
    assert spec is not None
    assert conditions(spec).values["dwell_time"][-3:] == pytest.approx([30.0, 2.0, 9.0])


def test_nothing_proposed_is_nothing_pushed(later: SimulationSpec) -> None:
    assert proposed_spec(later, [], np.random.default_rng(0)) is None


def test_continuation_holds_the_further_pushes_with_stamps_that_go_on(later: SimulationSpec) -> None:
    first = simulate(later)
    longer = random_spec(later, 6, np.random.default_rng(1))
    more = continuation(later, longer, int(first.slider.stamp[0]))
    assert first.rig is not None
    assert int(more.slider.stamp[0]) > int(first.slider.stamp[-1]) - 10**9
    windows = find_windows(more, first.rig)
    assert len({window.push_id for window in windows}) == 6
    begin = conditions(longer).values["elapsed_time"][len(later.pushes)]
    assert (windows[0].start - int(first.slider.stamp[0])) * 1e-9 == pytest.approx(begin, abs=2.0)


@pytest.mark.long
def test_command_continues_each_undecided_recording_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    data, truth, results, out = (tmp_path / name for name in ("data", "truth", "results", "out"))
    for folder in (truth, results):
        folder.mkdir()
    make_one(0, "library", 3, SMALL, data, truth)
    acting = json.loads((truth / "000.json").read_text())["covariates"][0]
    (results / "000.json").write_text(json.dumps(verdict(acting, "other", experiment=proposals(travel=[0.02] * 3))))
    asked: list[Path] = []

    def traced(folder: Path, more: Path) -> dict[str, Any]:
        asked.append(more)
        return verdict(acting) if more.name == "proposed" else verdict(acting, "other")

    monkeypatch.setattr(experiments, "_traced", traced)
    folders = [f"--{name}={folder}" for name, folder in zip(
        ("data", "truth", "results", "out"), (data, truth, results, out), strict=True
    )]  # fmt: skip
    with pytest.raises(SystemExit, match="as for `make`"):
        main([*folders, "--training", "25", "--least", "18", "--most", "19"])
    sized = [*folders, "--training", "25", "--least", "20", "--most", "24"]
    assert main(sized) == 0 and main(sized) == 0
    assert [path.name for path in asked] == ["proposed", "random"]
    found = json.loads((out / "000.json").read_text())
    assert (found["proposed"]["pushes"], found["random"]["pushes"]) == (3, 20)
    assert found["proposed"]["outcome"] == SETTLED_RIGHT and found["random"]["outcome"] == UNDECIDED
    assert "| proposed | 1 | 0 | 0 | 0 |" in capsys.readouterr().out

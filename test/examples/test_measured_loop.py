# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The residual loop on measured pushes: its report, the skip without data, and a whole loop through the nodes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from ros_harness import free_domain

from examples import measured_loop
from examples.loop import ClosedLoop, Traced
from examples.loop_picture import DEPLOYED, EXTENDED, Story
from examples.measured_loop import REFIT, Outcome, main, to_json, to_text
from examples.measured_recordings import Split
from push_predictor.evaluation.validation import Comparison
from push_predictor.recordings.streams import Recording

EFFECT = {
    "mechanism": "pressure_spread",
    "covariate": "model_inputs",
    "form": "constant",
    "parameter": {"value": -0.7, "low": -0.8, "high": -0.5, "unit": "1"},
}


def comparison(error: float, pushes: int) -> Comparison:
    """Three windows a push whose predictions are off by about `error`; the deviation is predicted right."""
    rng = np.random.default_rng(0)
    n = 3 * pushes
    off = error * rng.normal(size=(n, 3))
    observed = rng.normal(size=(n, 3))
    ids = np.repeat([f"push-{k}" for k in range(pushes)], 3)
    covariance = np.tile(error**2 * np.eye(3), (n, 1, 1))
    return Comparison("m", 10, ids, observed + off, covariance, observed, None, np.zeros(3))


def outcome(recording: Recording, later: dict[str, float], pushes: int = 20) -> Outcome:
    """The outcome of a loop; later: the error of each model on the later pushes."""
    split = Split("mlab one to two", recording, recording, recording, "a support was changed")
    traced = Traced("", {"verdict": "mechanism_only", "effects": [EFFECT]}, None)
    closed = ClosedLoop(Story({}, {}, 30, None), None, traced, "")
    counts = {"training": (50, 1000), "traced": (1, 15), "later": (pushes, 3 * pushes)}
    alarm = {"fired": False, "pushes": 30, "log10_evidence": 0.9, "off": None}
    return Outcome(split, counts, alarm, closed, {name: comparison(error, pushes) for name, error in later.items()})


# --- the report -------------------------------------------------------------------------------------------------


def test_extension_that_beats_both_models_on_later_pushes_is_called_better(recording: Recording) -> None:
    found = outcome(recording, {DEPLOYED: 0.5, REFIT: 0.4, EXTENDED: 0.1})
    assert to_text(found).startswith("mlab one to two. The extended model is better on the later pushes.")
    values = to_json(found)["differences"]["extended − refit"]["nlpd"]
    assert values["low"] <= values["value"] <= values["high"] < 0.0


def test_one_later_push_has_no_interval(recording: Recording) -> None:
    found = outcome(recording, {DEPLOYED: 0.5, REFIT: 0.4, EXTENDED: 0.1}, pushes=1)
    assert "(one push)" in to_text(found)
    assert to_json(found)["later"][DEPLOYED]["nmse"]["low"] is None
    assert "no certain gain" in to_text(found)
    json.dumps(to_json(found), allow_nan=False)


# --- the command ------------------------------------------------------------------------------------------------


def test_without_the_data_it_states_which_folder_is_absent_and_succeeds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--data", str(tmp_path / "absent"), "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert said.count("SKIPPED") == 2 and str(tmp_path / "absent" / "mlab") in said and "--data FOLDER" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_steel_block_runs_through_the_nodes_and_is_too_short_for_a_trace(
    measured_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each run is one push; the trace needs twelve. The replays, the validations and the report work all the same."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(free_domain()))
    monkeypatch.setitem(measured_loop.RATES, "mcube", (20.0, 20.0))
    assert main(["--data", str(measured_data), "--kind", "mcube", "--only", "steel", "--out", str(tmp_path)]) == 0
    (found,) = json.loads((tmp_path / "measured_loop.json").read_text())
    assert [part["pushes"] for part in found["split"].values()] == [2, 1, 1]
    assert found["alarm"]["off"] and "at least 12" in found["trace"]["failed"]
    online, offline = (found["later"][name]["nmse"]["value"] for name in (DEPLOYED, REFIT))  # the same mean
    assert online == pytest.approx(offline, rel=1e-6) and 0.0 < online < 1.0
    assert "Nothing was found" in capsys.readouterr().out

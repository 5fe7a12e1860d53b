# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parts of the demo's residual loop that need no nodes: the hidden effect and where it is kept."""

import json
from dataclasses import replace

import numpy as np
import pytest

from examples import hidden
from examples.hidden import make_hidden
from push_predictor.recordings.read import read_recording
from push_predictor.simulation.rig_simulator import simulate


@pytest.fixture
def short(monkeypatch):
    """Few pushes, and short ones."""
    for name, value in (("PLAIN", 2), ("TRACED", 3), ("REST", 2), ("TRAVEL", 0.012)):
        monkeypatch.setattr(hidden, name, value)


@pytest.fixture
def simulated(monkeypatch):
    """The specs that are simulated."""
    specs = []
    monkeypatch.setattr(hidden, "simulate", lambda spec: specs.append(spec) or simulate(spec))
    return specs


@pytest.mark.slow
def test_effect_begins_late_and_truth_is_stored_separately(tmp_path, short, simulated):
    places = make_hidden(tmp_path, 3)
    part, whole = read_recording(places.recorded), read_recording(places.whole)
    n = len(part.slider)
    assert 0.5 < n / len(whole.slider) < 0.95
    np.testing.assert_array_equal(part.slider.x, whole.slider.x[:n])
    plain = simulate(replace(simulated[0], changes=hidden.Changes()))
    begins = hidden.conditions(simulated[0]).values["elapsed_time"][2]
    early = plain.slider.stamp <= plain.slider.stamp[0] + begins * 1e9
    same = np.count_nonzero(early)
    np.testing.assert_allclose(plain.slider.x[:same], whole.slider.x[:same], atol=1e-9)
    longest = min(len(plain.slider), len(whole.slider))
    assert np.max(np.abs(plain.slider.x[:longest] - whole.slider.x[:longest])) > 1e-4
    told = json.loads(places.truth.read_text())
    assert told["from push"] == 2
    assert places.truth.parent not in (places.recorded, places.whole)
    assert not any(told["mechanism"].encode() in path.read_bytes() for path in places.recorded.iterdir())

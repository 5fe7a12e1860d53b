# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0
"""Stamps with jitter: its estimate, regular stamps in place of it, and the accuracy of what is learnt from them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from checked_bags import bag, found, rig_of
from hypothesis import given, settings
from hypothesis import strategies as st

from push_predictor.evaluation.alarm.scores import alarm_state, calibrate
from push_predictor.evaluation.validation import compare, metrics_json
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.online.stream_health import stamp_figures
from push_predictor.recordings.read import require_rig
from push_predictor.recordings.streams import Recording, taken
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows import regular_stamps
from push_predictor.recordings.windows.finder import WindowFinder, find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.recordings.windows.regular_stamps import (
    AROUND,
    DECIDING,
    MOST_WIDTH,
    RegularStamps,
    missing_before,
    stamp_noise,
    width,
)
from push_predictor.recordings.windows.stamp_order import OrderedSamples, uninterrupted
from push_predictor.types import IntArray

MS = 1_000_000
START = 1_700_000_000_000 * MS


def grid(count: int, period: float = 10.0) -> IntArray:
    """Stamps (n,) in ns of a regular stream; period in ms."""
    return np.asarray(START + np.rint(period * MS * np.arange(count)), dtype=np.int64)


def noisy(stamp: IntArray, sd: float, seed: int = 0) -> IntArray:
    """Stamps with a Gaussian jitter, sd in ms, in the order of the samples."""
    return np.asarray(stamp + np.rint(sd * MS * np.random.default_rng(seed).standard_normal(len(stamp))), np.int64)


def samples(stamp: IntArray) -> OrderedSamples:
    return uninterrupted(stamp, np.arange(len(stamp))[:, None] * 1.0)


def regular(stamp: IntArray, portion: int = 10**9) -> IntArray:
    """The stamps that samples get, taken in portions."""
    taker, parts = RegularStamps(), []
    whole = samples(stamp)
    for first in [*range(0, len(stamp), portion), len(stamp)]:
        parts.append(taker.take(taken(whole, slice(first, first + portion)), final=first == len(stamp)))
    assert np.array_equal(np.concatenate([part.values for part in parts]), whole.values) and not taker.waiting
    return np.concatenate([part.stamp for part in parts])


# --- the estimate -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sd", [0.2, 1.0, 3.0])
def test_jitter_is_the_standard_deviation_of_a_stamp(sd: float) -> None:
    stamp = np.delete(grid(3000), slice(500, 520))
    found = stamp_noise(noisy(stamp, sd))
    assert (found.period, found.jitter) == (pytest.approx(0.01, rel=0.02), pytest.approx(1e-3 * sd, rel=0.05))
    assert found.corrected == (sd > 0.5)
    figures = stamp_figures(noisy(stamp, sd), None)
    assert figures == f"{1.0 / found.period:.1f} Hz, stamp jitter {1e3 * found.jitter:.2g} ms"


def test_too_few_stamps_have_no_noise() -> None:
    assert stamp_noise(grid(9)) is None and stamp_noise(grid(10)) is not None
    assert stamp_noise(np.full(50, START)) is None


@pytest.mark.parametrize("kind", ["gaussian", "delay", "exponential"])
def test_jitter_is_recognised_by_few_samples_whatever_its_distribution(kind: str) -> None:
    found = []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        delay = rng.exponential(2.0, DECIDING) if kind == "exponential" else 2.0 * rng.standard_normal(DECIDING)
        delay = np.abs(delay) if kind == "delay" else delay
        noise = stamp_noise(np.sort(grid(DECIDING) + np.rint(MS * delay).astype(np.int64)))
        found.append(noise is not None and noise.corrected)
    assert np.mean(found) > 0.9


@pytest.mark.parametrize("share", [0.06, 0.4])
def test_exact_stamps_of_irregular_samples_are_no_jitter(share: float) -> None:
    for seed in range(50):
        step = 10 * MS * np.maximum(1.0 + share * np.random.default_rng(seed).standard_normal(DECIDING), 0.01)
        noise = stamp_noise(START + np.cumsum(np.rint(step)).astype(np.int64))
        assert noise is not None and not noise.corrected


# --- regular stamps ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("sd", "left"), [(1.3, 0.2), (3.0, 0.9)])
def test_regular_stamps_are_near_the_true_times(sd: float, left: float) -> None:
    true = grid(2000)
    stamp = np.maximum.accumulate(noisy(true, sd) - np.arange(2000)) + np.arange(2000)
    error = (regular(stamp) - true) / MS
    assert np.std(error) < left and np.abs(error).max() < 8 * left and abs(error.mean()) < 0.2 * sd


def test_a_slow_drift_of_the_rate_is_kept() -> None:
    true = np.asarray(START + np.cumsum(10 * MS + np.linspace(0.0, 0.2 * MS, 3000)), dtype=np.int64)
    assert np.std(regular(noisy(true, 1.3)) - true) < 0.26 * MS


def test_missing_samples_are_counted() -> None:
    true = np.delete(grid(2000), [300, 301, 700, 1100, 1101, 1102, 1500])
    stamp = noisy(true, 1.3)
    noise = stamp_noise(stamp[:DECIDING])
    found = missing_before(stamp, noise)
    assert dict(zip(np.flatnonzero(found).tolist(), found[found > 0].tolist(), strict=True)) == {
        300: 2,
        698: 1,
        1097: 3,
        1494: 1,
    }
    assert np.std(regular(stamp) - true) < 0.26 * MS


def test_no_sample_is_missing_in_a_regular_stream() -> None:
    for sd in (1.3, 2.0):
        noise = stamp_noise(noisy(grid(3000), sd))
        assert noise is not None and width(noise) < width(replace(noise, jitter=2 * noise.jitter))
        assert not missing_before(noisy(grid(3000), sd), noise).any()
    assert noise is not None and not missing_before(grid(4 * width(noise)), noise).any()


def test_a_gap_separates_the_lines_on_either_side() -> None:
    true = np.concatenate([grid(400), grid(400) + 4_055 * MS])  # not a multiple of the period
    error = (regular(noisy(true, 1.3)) - true) / MS
    assert np.abs(error).max() < 1.3, "at the ends a line is less certain"


def test_data_that_are_missing_separate_the_lines_too() -> None:
    true = np.concatenate([grid(200), grid(200) + 2_004 * MS])
    whole = samples(noisy(true, 1.3))
    whole.interrupted[200] = True
    assert np.abs(RegularStamps().take(whole, final=True).stamp - true).max() < 1.56 * MS


def test_jitter_that_begins_later_is_replaced_from_the_next_samples_on() -> None:
    true = grid(1000)
    stamp = np.where(np.arange(1000) < 3 * DECIDING, true, noisy(true, 2.0))
    found = regular(stamp)
    assert np.array_equal(found[: 4 * DECIDING], stamp[: 4 * DECIDING])
    assert np.std(found[4 * DECIDING :] - true[4 * DECIDING :]) < 0.5 * MS


def test_a_short_stream_is_decided_by_what_there_is() -> None:
    assert np.std(regular(noisy(grid(60), 2.0)) - grid(60)) < 1.0 * MS
    few = noisy(grid(9), 2.0)
    assert np.array_equal(regular(few), few)


@pytest.mark.parametrize(("sd", "portion"), [(0.0, 3), (1.3, 3), (2.0, DECIDING)])
def test_the_stamps_do_not_depend_on_the_portions(sd: float, portion: int) -> None:
    rng = np.random.default_rng(3)
    true = np.delete(grid(1500), [*rng.integers(0, 1500, 12), *range(800, 830)])
    stamp = noisy(true, sd)
    assert np.array_equal(regular(stamp, portion), regular(stamp))


def test_the_stamps_do_not_depend_on_how_many_are_fitted_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    stamp = noisy(grid(700), 1.3)
    whole = regular(stamp)
    monkeypatch.setattr(regular_stamps, "ROWS", 90)
    assert np.array_equal(regular(stamp), whole)


@settings(max_examples=30, deadline=None)
@given(sd=st.floats(0.0, 6.0), seed=st.integers(0, 9), missing=st.lists(st.integers(0, 699), max_size=60))
def test_regular_stamps_increase(sd: float, seed: int, missing: list[int]) -> None:
    stamp = np.delete(np.sort(noisy(grid(700), sd, seed)), missing)
    stamp = stamp[np.diff(stamp, prepend=0) > 0]
    assert (np.diff(regular(stamp)) > 0).all()


def test_few_samples_are_kept() -> None:
    taker, stamp = RegularStamps(), noisy(grid(4000), 1.3)
    for first in range(0, 4000, 50):
        taker.take(samples(stamp[first : first + 50]))
        segment = taker._segment
        assert taker.waiting <= max(DECIDING, AROUND + 3 * MOST_WIDTH + 50)
        assert segment is None or len(segment._samples.stamp) < 500


# --- recordings -------------------------------------------------------------------------------------------------------


def with_jitter(recording: Recording, sd: float, kind: str = "gaussian", seed: int = 0) -> Recording:
    """Jitter in the stamps of every stream, independent from sample to sample; sd in ms."""
    rng = np.random.default_rng(seed)

    def one(stream: Any) -> Any:
        noise = sd * MS * rng.standard_normal(len(stream))
        noise = np.abs(noise) if kind == "delay" else noise
        return replace(stream, stamp=stream.stamp + np.rint(noise).astype(np.int64))

    return replace(recording, slider=one(recording.slider), pusher=one(recording.pusher), wrench=one(recording.wrench))


@pytest.mark.parametrize("name", ["hexagon_delrin", "ellipse_plywood"])
def test_undisturbed_recordings_keep_their_stamps(name: str) -> None:
    for stream in bag(name).sensors.values():
        increasing = stream.stamp[np.diff(np.maximum.accumulate(stream.stamp), prepend=0) > 0]
        assert np.array_equal(regular(increasing), increasing)


def half(number: int) -> Recording:
    """The first or second half of a recording, of some 60 pushes."""
    recording = bag("square_abs_test")
    middle = int(recording.slider.stamp[len(recording.slider) // 2])
    streams = {k: taken(of, (of.stamp >= middle) == bool(number)) for k, of in recording.sensors.items()}
    return replace(recording, **streams)


def table_of(recording: Recording) -> PushTable:
    return windows_to_table(find_windows(recording, require_rig(recording)))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["gaussian", pytest.param("delay", marks=pytest.mark.long)])
def test_two_milliseconds_of_jitter_change_the_accuracy_by_less_than_five_percent(kind: str) -> None:
    """The alarm stays silent, too."""
    options = TrainingOptions(n_train=60, mean="zero")
    model = train_model(table_of(half(0)), require_rig(half(0)), "gp", name="square", options=options)
    clean, jittery = table_of(half(1)), table_of(with_jitter(half(1), 2.0, kind))
    assert len(jittery.pushes) == len(clean.pushes) > 55 and abs(len(jittery) - len(clean)) < 8
    found_clean, comparison = metrics_json(compare(model, clean)), compare(model, jittery)
    found_jittery = metrics_json(comparison)
    assert found_jittery["nmse"]["total"] < 1.05 * found_clean["nmse"]["total"]
    assert found_jittery["nlpd"]["total"] == pytest.approx(found_clean["nlpd"]["total"], abs=0.15)
    assert not alarm_state(calibrate(model), jittery, comparison.mean, comparison.covariance).fired


def test_windows_of_jittery_streams_are_the_same_online_and_offline() -> None:
    short = bag("circle_pu")
    recording = with_jitter(short, 2.0)
    rig, offline = require_rig(recording), find_windows(recording, require_rig(recording))
    finder, online = WindowFinder(rig), []
    for begin, end in pairwise(range(0, len(recording.slider) + 37, 37)):
        finder.add_wrench(taken(recording.wrench, slice(begin // 2, end // 2)))
        finder.add_pusher(taken(recording.pusher, slice(begin, end)))
        finder.add_slider(taken(recording.slider, slice(begin, end)))
        online += finder.take_ready()
    assert {*finder.stamp_jitter} == {"slider", "pusher", "wrench"}
    assert finder.stamp_jitter["slider"] == pytest.approx(0.002, rel=0.4)
    online += finder.finish()
    assert len(online) == len(offline) > 20
    for one, other in zip(online, offline, strict=True):
        assert (one.start, one.end, one.push_id) == (other.start, other.end, other.push_id)
        np.testing.assert_allclose(one.displacement, other.displacement, rtol=0.0, atol=1e-12)


def test_the_check_states_the_jitter_of_streams_with_samples() -> None:
    recording, rig = bag("circle_pu"), rig_of("circle_pu")
    sound = replace(recording, wrench=taken(recording.wrench, slice(0)))
    assert "stamp_jitter" not in found(sound, rig)
    finding = found(replace(sound, slider=with_jitter(recording, 2.0).slider), rig)["stamp_jitter"]
    assert finding.severity == "note" and "slider 2 ms (20 % of the period)." in finding.sentence
    assert [*finding.values] == ["slider_jitter"]
    assert finding.values["slider_jitter"].value == pytest.approx(2e-3, rel=0.1)

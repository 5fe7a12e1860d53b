# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Blind recordings: the truth stays out of the data, and the score separates right from wrong verdicts and sizes."""

from __future__ import annotations

import json
from dataclasses import replace
from math import expm1
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic import square_pushes

from benchmarks.blind.commands import main
from benchmarks.blind.effects import GROUPS, SIZES, World, draw
from benchmarks.blind.library import library_without
from benchmarks.blind.oracle import true_term
from benchmarks.blind.recordings import MODEL, Size, conditions, drawn_for, later_spec, make_one, rig_of
from benchmarks.blind.scores import score_of, wilson
from benchmarks.blind.true_parameter import covers
from push_predictor.models.mechanisms import LIBRARY
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.table import PushTable
from push_predictor.simulation.changes import Changes, Moment
from push_predictor.simulation.rig_simulator import push_outcomes
from push_predictor.simulation.sensors import Faults

SMALL = Size(training=12, least=8, most=10, rows=30, kind="analytical")


def gain_of(value: float, high: float = -0.01, traced: float = -0.5) -> dict[str, Any]:
    """An oracle's gain over the refit, and over the reference of a trace."""
    return {"value": value, "high": high, "traced": {"value": traced, "high": min(traced + 0.1, 0.0)}}


def truth(**other: Any) -> dict[str, Any]:
    record = {
        "group": "library", "channel": "motion", "kind": "contact_friction", "names": ["contact_friction"],
        "covariates": ["slid_distance"], "size": "large", "oracle_gain": gain_of(-0.6),
    }  # fmt: skip
    return {**record, **other}


def nothing() -> dict[str, Any]:
    return truth(group="none", channel="none", kind="none", names=[], covariates=[], size="none", oracle_gain=None)


def verdict(mechanism: str | None, covariate: str, **other: Any) -> dict[str, Any]:
    record = {
        "verdict": "effect", "effect_present": True, "channel": "motion", "kind": "mean", "covariates": [covariate],
        "equivalent": [], "motion_model_changed": True, "seconds": 10.0,
        "effects": [{"mechanism": mechanism, "covariate": covariate}],
        "gain": {"nlpd": {"value": -0.4, "low": -0.5, "high": -0.3}},
    }  # fmt: skip
    return {**record, **other}


def no_finding() -> dict[str, Any]:
    return {
        "verdict": "none", "effect_present": False, "channel": "none", "kind": None, "covariates": [], "equivalent": [],
        "motion_model_changed": False, "effects": [], "gain": {"nlpd": {"value": 0.0, "low": -0.01, "high": 0.01}},
    }  # fmt: skip


def counted(scored: dict[str, Any], what: str) -> tuple[int, int]:
    (found,) = [rate for rate in scored["rates"] if rate["what"] == what]
    return found["count"], found["of"]


def one(record: dict[str, Any], result: dict[str, Any]) -> dict[str, Any]:
    return dict(score_of({"000": record}, {"000": result})["judged"]["000"])


def effect(mechanism: str | None, covariate: str, **other: Any) -> dict[str, Any]:
    return {"mechanism": mechanism, "covariate": covariate, "form": "linear", "parameter": None} | other


def sized(low: float, high: float, **other: Any) -> dict[str, Any]:
    """A right verdict with an interval of its parameter."""
    return right(effects=[effect("contact_friction", "slid_distance", parameter={"low": low, "high": high})], **other)


def right(*further: tuple[str | None, str], **other: Any) -> dict[str, Any]:
    effects = [effect("contact_friction", "slid_distance"), *(effect(*each) for each in further)]
    return verdict("contact_friction", "slid_distance", **{"effects": effects, **other})


TWO = truth(second={
    "kind": "tilted_surface", "names": ["tilted_surface"], "covariates": ["push_heading", "session"],
})  # fmt: skip
BIAS = truth(channel="measurement", kind="wrench_bias", names=["wrench_bias"], covariates=[])
CLOCK = truth(channel="measurement", names=["clock_offset"], covariates=["model_inputs"], oracle_gain=None)
SHIFT = truth(channel="measurement", names=["frame_shift"], covariates=["model_inputs"], oracle_gain=None)
WRENCH = truth(group="wrench", channel="wrench", names=["surface_friction"], oracle_gain=None)
NOISY = truth(channel="variance", names=[], oracle_gain=None)
SIZED = truth(form="linear", course="linear", value=0.2, unit="1")
HARMLESS = no_finding() | {"harmless": [{"mechanism": "wrench_bias", "parameter": {"value": 0.5}}]}
REMOVED = {"without": "contact_friction"}
GOOD, BAD, SECOND = "found name driver in_set", "wrong harm unknown failed", "tilted_surface"


@pytest.mark.parametrize(("record", "result", "true", "false"), [
    (truth(), right(), GOOD, BAD),
    (truth(), verdict("pressure_spread", "slid_distance"), "driver wrong", "name"),
    (truth(), verdict("contact_friction", "elapsed_time", equivalent=["slid_distance"]), "name in_set", "driver wrong"),
    (BIAS, HARMLESS, "found name driver", ""),
    (BIAS, no_finding(), "", "found"),
    (truth(), HARMLESS, "", "found wrong"),
    (truth(), verdict(None, "slid_distance", verdict="driver_only", **REMOVED), "outside unknown name", "wrong"),
    (truth(), verdict("pressure_spread", "slid_distance", **REMOVED), "outside wrong", "unknown"),
    (truth(), verdict("clock_offset", "model_inputs", channel="measurement", **REMOVED), "wrong", "found"),
    (WRENCH, verdict("surface_friction", "slid_distance", verdict="wrench_only", channel="wrench"), "found", ""),
    (WRENCH, right(), "", "found"),
    (CLOCK, verdict("clock_offset", "clock_offset", verdict="measurement", channel="measurement"), "name in_set", ""),
    (NOISY, verdict(None, "slid_distance", verdict="variance", kind="variance"), "name", ""),
    (NOISY, right(), "", "name"),
    (TWO, verdict(SECOND, "model_inputs"), "two name driver", "both wrong"),
    (TWO, verdict(SECOND, "slid_distance"), "", "driver"),
    (TWO, right(), "driver", ""),
    (TWO, verdict("pressure_spread", "push_heading"), "wrong driver", "name"),
    (TWO, right((SECOND, "push_heading")), "both", "superfluous"),
    (truth(), right(), "", "superfluous"),
    (truth(), right(("contact_friction", "session")), "superfluous", ""),
    (truth(), right((None, "edge"), channel="wrench"), "", "superfluous"),
    (truth(), verdict("pressure_spread", "edge", effects=[
        effect("pressure_spread", "edge"), effect("contact_friction", "slid_distance")]), "", "superfluous"),
    (SHIFT, verdict("frame_shift", "model_inputs", channel="measurement",
                    effects=[effect("frame_shift", "model_inputs")] * 2), "", "superfluous"),
    (truth(covariates=["session"]), verdict("contact_friction", "model_inputs"), "driver in_set", ""),
    (truth(covariates=["model_inputs"]), verdict("contact_friction", "session"), "driver in_set", ""),
    (truth(), verdict("contact_friction", "session"), "", "driver in_set"),
    (SIZED, sized(0.15, 0.25), "covered", ""),
    (SIZED, sized(0.25, 0.3), "", "covered"),
])  # fmt: skip
def test_a_verdict_is_judged_by_what_was_planted(
    record: dict[str, Any], result: dict[str, Any], true: str, false: str
) -> None:
    judged = one(record, result)
    assert all(judged[name] for name in true.split()) and not any(judged[name] for name in false.split()), judged


def test_rates_count_what_they_name() -> None:
    shifted = nothing() | {"group": "input_shift", "covariates": ["velocity"]}
    moved = {"input_shift": [{"covariate": "velocity"}]}
    found = no_finding() | {"verdict": "input_shift", "effect_present": True, **moved}
    truths = {
        "a": nothing(), "b": nothing(), "c": truth(), "d": shifted, "e": shifted, "f": shifted, "g": SIZED,
        "h": truth(form="map", value=0.2, unit="1"),
    }  # fmt: skip
    scored = score_of(truths, {
        "a": no_finding(), "b": verdict("contact_friction", "edge"), "c": no_finding(), "d": found, "e": no_finding(),
        "f": right(**moved), "g": sized(0.15, 0.25), "h": sized(0.15, 0.25),
    })  # fmt: skip
    assert counted(scored, "false alarms on recordings without an effect") == (1, 2)
    assert counted(scored, "motion model changed without cause") == (2, 5)
    assert counted(scored, "found, mechanism in the library: large") == (2, 3)
    assert counted(scored, "input shift reported") == (2, 3)
    assert counted(scored, "input shift taken for an effect") == (1, 3)
    assert counted(scored, "interval of the parameter covers the true value") == (1, 1)
    assert scored["judged"]["c"]["share"] == 0.0


@pytest.mark.parametrize(("gain", "size"), [(-0.05, "small"), (-0.1, "medium"), (-0.4, "medium"), (-0.41, "large")])
def test_oracle_gain_decides_the_size_class(gain: float, size: str) -> None:
    assert one(truth(oracle_gain=gain_of(gain)), no_finding())["size"] == size


@pytest.mark.parametrize(
    ("gain", "share"), [(gain_of(-0.2, traced=-0.8), 0.5), (gain_of(-0.2, traced=-0.05), None), (gain_of(-0.05), None)]
)
def test_share_of_the_oracles_gain_counts_where_the_oracle_extends_the_model(gain: Any, share: float | None) -> None:
    """Both gains are over the better of the deployed model and the refit; the size is the gain over the refit."""
    assert one(truth(oracle_gain=gain), right())["share"] == pytest.approx(share)


def test_drivers_of_small_effects_count_where_an_oracle_could_decide() -> None:
    gains = [gain_of(-0.05), gain_of(-0.05, high=0.01), gain_of(-0.2, high=0.01), None]
    truths = {f"{number:03d}": truth(oracle_gain=gain) for number, gain in enumerate(gains)}
    scored = score_of(truths, dict.fromkeys(truths, right()))
    assert counted(scored, "right driver in the named set") == (3, 3)
    assert counted(scored, "right driver in the named set, all sizes") == (4, 4)


@pytest.mark.parametrize(("extended", "low", "harm", "refused"), [
    (True, 0.01, 1, 0), (False, 0.01, 0, 1), (True, -0.01, 0, 0), (False, -0.01, 0, 0),
])  # fmt: skip
def test_an_extension_that_makes_predictions_worse_is_harm_unless_it_is_refused(
    extended: bool, low: float, harm: int, refused: int
) -> None:
    result = right(motion_model_changed=extended, gain={"nlpd": {"value": 0.05, "low": low, "high": 0.1}})
    scored = score_of({"000": truth(), "001": truth()}, {"000": result, "001": {"failed": "no push"}})
    assert counted(scored, "harm: extended, interval of the gain wholly above zero") == (harm, 2)
    assert counted(scored, "extension refused, interval of the gain wholly above zero") == (refused, 2)
    assert wilson(27, 30) == pytest.approx((0.7438, 0.9654), abs=1e-4) and wilson(0, 0) == (0.0, 1.0)


@pytest.mark.long
def test_recording_contains_no_hint_of_the_truth(tmp_path: Path) -> None:
    data, hidden = tmp_path / "data", tmp_path / "truth"
    hidden.mkdir()
    drawn = make_one(3, "library", 7, SMALL, data, hidden)
    record = json.loads((hidden / "003.json").read_text())
    assert record["friction"] > 0.1 and (record["second"] is None) == (drawn.second is None)
    assert (record["kind"], record["group"], record["value"]) == (drawn.kind, "library", drawn.value)
    assert {path.relative_to(data).parts[0] for path in data.rglob("*")} == {"003"}
    assert sorted(path.name for path in (data / "003").iterdir()) == sorted([MODEL, "new"])
    recording = read_recording(data / "003" / "new")
    assert {name.strip("/") for name in recording.scalars} == {"surface/temperature", "room/humidity"}
    hints = [drawn.kind, "library", str(hidden), "medium", *(name for name in drawn.names if name)]
    for path in (data / "003" / "new").iterdir():
        assert not any(hint.encode() in path.read_bytes() for hint in hints if hint != "contact_friction"), path


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS)
def test_every_kind_of_effect_can_be_drawn_and_changes_outcomes(group: str) -> None:
    spec = later_spec(rig_of(np.random.default_rng(2), "x", 8), np.random.default_rng(3), 8)
    drawn = [drawn_for(spec, group, np.random.default_rng(seed)) for seed in range(12)]
    assert {one.size for one in drawn} == set(SIZES)
    assert {one.kind for one in drawn} <= {kind.name for kind in GROUPS[group]}
    assert all(one.covariates and one.unit and one.value != 0.0 for one in drawn)
    first = drawn[0].act
    if isinstance(first, Changes):
        plain, changed = push_outcomes(spec), push_outcomes(replace(spec, changes=first))
        assert len(plain) != len(changed) or np.any(plain.outcomes != changed.outcomes)
    else:
        assert first != Faults()


def test_an_onset_is_a_step_in_mid_session() -> None:
    spec = later_spec(rig_of(np.random.default_rng(2), "x", 8), np.random.default_rng(3), 40)
    world = World(spec.slider.outline, 10.0, 0.2, conditions(spec), np.random.default_rng(5))
    assert all("onset" in kind.drivers for kind in GROUPS["library"])
    drawn = draw(replace(GROUPS["library"][0], drivers=("onset",)), "medium", world)
    assert (drawn.form, drawn.course, drawn.covariates[0]) == ("step", "step", "push_index")
    assert drawn.place is not None and 0.25 * 40 < drawn.place < 0.75 * 40
    assert isinstance(drawn.act, Changes) and drawn.act.contact_friction is not None
    given = world.conditions
    moment = Moment(given, np.zeros((40, 3)), np.zeros((40, 3)), np.zeros(40), np.zeros(40))
    on = given.values["push_index"] >= drawn.place
    assert np.array_equal(drawn.act.contact_friction(moment), np.where(on, drawn.value, 0.0))


def test_mechanism_is_removed_only_inside_the_context() -> None:
    from push_predictor.residuals.candidates import candidate

    with library_without("tilted_surface"):
        assert "tilted_surface" not in {mechanism.name for mechanism in candidate.LIBRARY}
    assert candidate.LIBRARY is LIBRARY
    with pytest.raises(SystemExit, match="perpetual"), library_without("perpetual"):
        pass


@pytest.mark.long
def test_all_steps_on_small_recordings_write_a_table(tmp_path: Path) -> None:
    """No effect, an effect of the library and a change of the wrench, each on 60 pushes."""
    data, hidden, results = (tmp_path / name for name in ("data", "truth", "results"))
    small = ["--training", "60", "--least", "60", "--most", "60", "--rows", "100", "--model", "gp", "--mean", "zero"]
    make = ["make", "--out", str(data), "--truth", str(hidden), "--seed", "177", "--count", "3", "--cores", "1", *small]
    main(make)
    made = {path: path.stat().st_mtime_ns for path in data.rglob("*")}
    main(make)  # keeps what exists
    assert {path: path.stat().st_mtime_ns for path in data.rglob("*")} == made
    main(["run", "--data", str(data), "--out", str(results), "--cores", "1"])
    main(["oracle", "--data", str(data), "--truth", str(hidden), "--cores", "1"])
    table, scored = tmp_path / "table.md", tmp_path / "score.json"
    main(["score", "--results", str(results), "--truth", str(hidden), "--json", str(scored), "--markdown", str(table)])
    record = json.loads(scored.read_text())
    assert record["recordings"] == 3
    assert counted(record, "traces that failed") == (0, 3)
    assert counted(record, "motion model changed without cause") == (0, 2)
    assert counted(record, "harm: extended, interval of the gain wholly above zero") == (0, 3)
    assert counted(record, "wrench-only changes reported as such") == (1, 1)
    assert "motion model changed without cause | 0 of 2" in table.read_text()


# --- true parameter ---------------------------------------------------------------------------------------------------


def planted(kind: str, value: float, unit: str, **other: Any) -> dict[str, Any]:
    record = {"kind": kind, "value": value, "unit": unit, "form": "constant", "covariates": ["session"]}
    return {**record, "friction": 0.25, "engine": "own", **other}


def covered(
    record: dict[str, Any], value: float, form: str = "constant", covariate: str = "model_inputs"
) -> bool | None:
    """Of an interval of 1 % about a value."""
    low, high = sorted((0.99 * value, 1.01 * value))
    reported = {
        "mechanism": record["kind"],
        "form": form,
        "covariate": covariate,
        "parameter": {"low": low, "high": high},
    }
    return covers(record, record, reported)


@pytest.mark.parametrize(("kind", "value", "unit", "parameter"), [
    ("contact_friction", -0.2, "1", -0.2),
    ("centre_of_friction", -0.01, "m", 0.01),
    ("anisotropic_friction", -0.3, "1", 0.3),
    ("body_anisotropy", -0.3, "1", 0.3),
    ("tilted_surface", -0.05, "N/N", 0.2),
    ("tilted_surface", 0.05, "of the weight", 0.2),
    ("surface_friction", -0.4, "1", expm1(-0.4)),
    ("surface_friction", -0.4, "of its value", -0.4),
    ("clock_offset", 0.015, "s", 0.015),
    ("frame_rotation", -0.03, "rad", -0.03),
])  # fmt: skip
def test_constant_parameters_are_compared_in_the_unit_of_the_library(
    kind: str, value: float, unit: str, parameter: float
) -> None:
    record = planted(kind, value, unit)
    assert covered(record, parameter) is True
    assert covered(record, 1.1 * parameter) is False
    assert covered(record, -parameter) is False
    assert covered(record, parameter, "step", "session") is True


@pytest.mark.parametrize(("kind", "unit"), [
    ("pressure_spread", "1"), ("pressure_spread", "of the load's rms radius"), ("anisotropic_friction", "of the mean"),
    ("frame_shift", "m"), ("wrench_bias", "N"), ("ballast", "kg"),
])  # fmt: skip
def test_parameters_of_another_meaning_are_not_compared(kind: str, unit: str) -> None:
    assert covered(planted(kind, 0.1, unit), 0.1) is None


def test_truths_that_lack_what_a_comparison_needs_are_not_compared() -> None:
    tilted, centre = planted("tilted_surface", 0.05, "N/N"), planted("centre_of_friction", 0.01, "m")
    assert covered({key: value for key, value in tilted.items() if key != "friction"}, 0.2) is None
    assert covered({key: value for key, value in centre.items() if key != "engine"}, 0.01) is None
    record = planted("contact_friction", 0.2, "1")
    reported = {"mechanism": "tilted_surface", "form": "constant", "covariate": "session"}
    assert covers(record, record, {**reported, "parameter": {"low": 0.1, "high": 0.3}}) is None
    assert covers(record, record, {**reported, "mechanism": "contact_friction", "parameter": None}) is None


@pytest.mark.parametrize(("form", "covariates", "reported_form", "covariate", "share"), [
    ("constant", ["session"], "linear", "session", None),
    ("constant", ["session"], "step", "push_index", None),
    ("step", ["push_index"], "step", "push_index", 1.0),
    ("step", ["push_index"], "step", "elapsed_time", 1.0),
    ("step", ["topic:/room/humidity"], "step", "topic:/room/humidity", 1.0),
    ("step", ["topic:/room/humidity"], "step", "push_index", None),
    ("step", ["push_index"], "linear", "push_index", None),
    ("linear", ["elapsed_time"], "linear", "elapsed_time", 0.9),
    ("linear", ["elapsed_time"], "linear", "slid_distance", 0.9),
    ("linear", ["elapsed_time"], "step", "elapsed_time", None),
    ("linear", ["topic:/room/humidity"], "linear", "topic:/room/humidity", None),
    ("linear", ["velocity"], "linear", "velocity", None),
    ("saturating", ["elapsed_time"], "linear", "elapsed_time", None),
    ("saturating", ["elapsed_time"], "logarithmic", "elapsed_time", None),
])  # fmt: skip
def test_forms_must_agree(
    form: str, covariates: list[str], reported_form: str, covariate: str, share: float | None
) -> None:
    record = planted("contact_friction", 0.2, "1", form=form, covariates=covariates)
    saturating = {**record, "course": "saturating"}  # the course decides where a truth has one
    assert form == "step" or covered(saturating, 0.2 * (share or 1.0), reported_form, covariate) is None
    assert covered(record, 0.2 * (share or 1.0), reported_form, covariate) is (None if share is None else True)


# --- blind oracle -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def table() -> PushTable:
    plain, _ = square_pushes(40)
    rng = np.random.default_rng(1)
    index = np.arange(len(plain), dtype=np.float64)
    covariates = {"push_index": index, "elapsed_time": 3.0 * index, "dwell_time": rng.exponential(2.0, len(plain))}
    covariates |= {"slider_x": rng.normal(size=len(plain)), "slider_y": rng.normal(size=len(plain))}
    covariates |= {"contact": plain.inputs[:, 1], "edge": np.floor(4.0 * plain.inputs[:, 1]), "slider_heading": index}
    return replace(plain, covariates=covariates)


@pytest.mark.parametrize(("covariates", "form", "name", "course", "expected"), [
    (["session", "model_inputs"], "constant", "contact_friction", None, "constant"),
    (["session", "slider_x"], "constant", None, None, "constant"),
    (["push_index", "elapsed_time"], "step", "contact_friction", None, "step"),
    (["elapsed_time"], "linear", "contact_friction", None, "linear"),
    (["elapsed_time"], "linear", "contact_friction", "saturating", "logarithmic"),
    (["elapsed_time"], "saturating", "contact_friction", None, "logarithmic"),
    (["dwell_time", "time_since_contact"], "saturating", None, None, "logarithmic"),
    (["slider_x", "slider_y", "session"], "map", None, None, "map"),
    (["contact", "session", "edge"], "map", None, None, "quadratic"),
    (["edge", "contact"], "category", "contact_friction", None, "category"),
    (["slider_heading", "session"], "periodic", None, None, "periodic"),
])  # fmt: skip
def test_true_basis_follows_from_form_and_covariates(
    table: PushTable, covariates: list[str], form: str, name: str | None, course: str | None, expected: str
) -> None:
    record = {"names": [name], "covariates": covariates, "form": form, "place": 17.0}
    mechanism, covariate, basis = true_term(record if course is None else {**record, "course": course}, table)
    assert (mechanism, covariate, basis.name) == (name, covariates[0], expected)
    assert basis.place == 17.0 or form != "step"

"""Blind recordings: the truth stays out of the data, and the score separates right from wrong verdicts."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.blind.commands import CYCLE, _group, apart, main
from benchmarks.blind.effects import DRIVERS, GROUPS, SIZES, undisturbed
from benchmarks.blind.library import library_without
from benchmarks.blind.recordings import MODEL, Size, drawn_for, later_spec, make_one, rig_of
from benchmarks.blind.scores import markdown_of, score_of, wilson
from push_predictor.models.mechanisms import LIBRARY
from push_predictor.recordings.read import read_recording
from push_predictor.simulation.changes import Changes
from push_predictor.simulation.rig_simulator import push_outcomes
from push_predictor.simulation.sensors import Faults

SMALL = Size(training=25, least=20, most=24, rows=40, kind="analytical")


def truth(**other: Any) -> dict[str, Any]:
    record = {
        "group": "library", "channel": "motion", "kind": "contact_friction", "names": ["contact_friction"],
        "covariates": ["slid_distance"], "size": "large", "oracle_gain": {"value": -0.5},
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


def test_correct_mechanism_and_covariate_score_in_every_column() -> None:
    judged = one(truth(), verdict("contact_friction", "slid_distance"))
    assert judged["found"] and judged["name"] and judged["driver"] and judged["in_set"] and judged["set_size"] == 1
    assert not (judged["wrong"] or judged["harm"] or judged["unknown"] or judged["failed"])
    assert judged["share"] == pytest.approx(0.8)


def test_score_separates_wrong_mechanism_from_wrong_covariate() -> None:
    mechanism = one(truth(), verdict("pressure_spread", "slid_distance"))
    driver = one(truth(), verdict("contact_friction", "elapsed_time", equivalent=["slid_distance", "push_index"]))
    assert (mechanism["name"], mechanism["driver"], mechanism["wrong"]) == (False, True, True)
    assert (driver["name"], driver["driver"], driver["in_set"], driver["set_size"]) == (True, False, True, 3)


def test_no_finding_is_correct_without_an_effect_and_a_miss_otherwise() -> None:
    scored = score_of({"000": nothing(), "001": truth(), "002": nothing()}, {
        "000": no_finding(), "001": no_finding(), "002": verdict("contact_friction", "edge"),
    })  # fmt: skip
    assert counted(scored, "false alarms on recordings without an effect") == (1, 2)
    assert counted(scored, "motion model changed without cause") == (1, 2)
    assert counted(scored, "found, mechanism in the library: large") == (0, 1)
    assert scored["judged"]["001"]["share"] == 0.0


def test_removed_mechanism_must_be_reported_as_unknown() -> None:
    run = {"without": "contact_friction"}
    unknown = one(truth(), verdict(None, "slid_distance", verdict="driver_only", **run))
    named = one(truth(), verdict("pressure_spread", "slid_distance", **run))
    assert unknown["outside"] and unknown["unknown"] and unknown["name"] and not unknown["wrong"]
    assert named["outside"] and named["wrong"] and not named["unknown"]
    clock = verdict("clock_offset", "model_inputs", verdict="measurement", channel="measurement", **run)
    assert one(truth(), clock)["wrong"] and not one(truth(), clock)["found"]


def test_wrench_measurement_and_variance_score_on_their_own_channels() -> None:
    wrench = truth(group="wrench", channel="wrench", names=["surface_friction"], oracle_gain=None)
    record = verdict("surface_friction", "slid_distance", verdict="wrench_only", channel="wrench")
    assert one(wrench, record)["found"] and not one(wrench, verdict("contact_friction", "slid_distance"))["found"]
    clock = truth(channel="measurement", names=["clock_offset"], covariates=["model_inputs"], oracle_gain=None)
    right = verdict("clock_offset", "clock_offset", verdict="measurement", channel="measurement")
    assert one(clock, right)["name"] and one(clock, right)["in_set"]
    noisy = truth(channel="variance", names=[], oracle_gain=None)
    assert one(noisy, verdict(None, "slid_distance", verdict="variance", kind="variance"))["name"]
    assert not one(noisy, verdict("contact_friction", "slid_distance"))["name"]


def test_counts_harm_and_failures() -> None:
    harmful = verdict("contact_friction", "slid_distance", gain={"nlpd": {"value": 0.2, "low": 0.1, "high": 0.3}})
    failed = {"failed": "TableError: no", "without": None, "seconds": 1.0}
    scored = score_of({"000": truth(), "001": truth()}, {"000": harmful, "001": failed})
    assert counted(scored, "harm: interval of the gain wholly above zero") == (1, 2)
    assert counted(scored, "traces that failed") == (1, 2)


@pytest.mark.parametrize(("gain", "size"), [(-0.05, "small"), (-0.1, "medium"), (-0.4, "medium"), (-0.41, "large")])
def test_oracle_gain_decides_the_size_class(gain: float, size: str) -> None:
    assert one(truth(oracle_gain={"value": gain}), no_finding())["size"] == size


def test_intervals_are_wilson_intervals() -> None:
    assert wilson(0, 30) == pytest.approx((0.0, 0.1135), abs=1e-4)
    assert wilson(27, 30) == pytest.approx((0.7438, 0.9654), abs=1e-4)
    assert wilson(0, 0) == (0.0, 1.0)


def test_table_marks_rates_without_recordings() -> None:
    text = markdown_of(score_of({"000": nothing()}, {"000": no_finding()}))
    assert "| false alarms on recordings without an effect | 0 of 1 | 0 to 79 % | at most 2 in 30 |" in text
    assert "no such recording" in text


def test_rejects_truth_folder_inside_data_folder(tmp_path: Path) -> None:
    apart(tmp_path / "data", tmp_path / "truth")
    for truth_folder in (tmp_path / "data", tmp_path / "data" / "truth", tmp_path):
        with pytest.raises(SystemExit, match="must not contain each other"):
            apart(tmp_path / "data", truth_folder)


@pytest.mark.slow
def test_recording_contains_no_hint_of_the_truth(tmp_path: Path) -> None:
    data, hidden = tmp_path / "data", tmp_path / "truth"
    hidden.mkdir()
    drawn = make_one(3, "library", 7, SMALL, data, hidden)
    record = json.loads((hidden / "003.json").read_text())
    assert (record["kind"], record["group"], record["value"]) == (drawn.kind, "library", drawn.value)
    assert {path.relative_to(data).parts[0] for path in data.rglob("*")} == {"003"}
    assert sorted(path.name for path in (data / "003").iterdir()) == sorted([MODEL, "new"])
    recording = read_recording(data / "003" / "new")
    assert {name.strip("/") for name in recording.scalars} == {"surface/temperature", "room/humidity"}
    hints = [drawn.kind, "library", str(hidden), "medium", *(name for name in drawn.names if name)]
    for path in (data / "003" / "new").iterdir():
        assert not any(hint.encode() in path.read_bytes() for hint in hints if hint != "contact_friction"), path


@pytest.mark.slow
def test_making_again_keeps_existing_recordings(tmp_path: Path) -> None:
    call = ["make", "--out", str(tmp_path / "data"), "--truth", str(tmp_path / "truth"), "--count", "1"]
    call += ["--training", "25", "--least", "20", "--most", "22", "--rows", "40", "--model", "analytical"]
    call += ["--cores", "1"]
    main(call)
    model = tmp_path / "data" / "000" / MODEL
    before = model.stat().st_mtime_ns
    main(call)
    assert model.stat().st_mtime_ns == before


def test_groups_keep_their_shares_in_random_order() -> None:
    groups = [[_group(seed, k) for k in range(len(CYCLE))] for seed in (1, 2)]
    assert sorted(groups[0]) == sorted(groups[1]) == sorted(CYCLE)
    assert groups[0] != groups[1]


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS)
def test_every_kind_of_effect_can_be_drawn_and_changes_outcomes(group: str) -> None:
    spec = later_spec(rig_of(np.random.default_rng(2), "x", 8), np.random.default_rng(3), 8)
    drawn = [drawn_for(spec, group, np.random.default_rng(seed)) for seed in range(25)]
    assert {one.size for one in drawn} == set(SIZES)
    assert {one.kind for one in drawn} <= {kind.name for kind in GROUPS[group]}
    assert all(one.covariates and one.unit and one.value != 0.0 for one in drawn)
    first = drawn[0].act
    if isinstance(first, Changes):
        plain, changed = push_outcomes(spec), push_outcomes(replace(spec, changes=first))
        assert len(plain) != len(changed) or np.any(plain.outcomes != changed.outcomes)
    else:
        assert first != Faults()


def test_equal_seeds_draw_equal_truths() -> None:
    spec = later_spec(rig_of(np.random.default_rng(2), "x", 8), np.random.default_rng(3), 8)
    assert drawn_for(spec, "library", np.random.default_rng(5)) == drawn_for(spec, "library", np.random.default_rng(5))


def test_covariates_have_documented_names() -> None:
    known = {"slid_distance", "elapsed_time", "push_index", "dwell_time", "velocity", "edge", "slider_x", "slider_y"}
    known |= {"push_heading", "slider_heading"}
    for driver in DRIVERS.values():
        assert all(name in known or name.startswith("topic:/") for name in driver.covariates)
    assert undisturbed().channel == "none"


def test_mechanism_is_removed_only_inside_the_context() -> None:
    from push_predictor.residuals.candidates import enumeration

    with library_without("tilted_surface"):
        assert "tilted_surface" not in {mechanism.name for mechanism in enumeration.LIBRARY}
    assert enumeration.LIBRARY is LIBRARY
    with pytest.raises(SystemExit, match="perpetual"), library_without("perpetual"):
        pass


@pytest.mark.slow
def test_all_steps_on_small_recordings_write_a_table(tmp_path: Path) -> None:
    """No effect, an effect of the library and a change of the wrench, each on 60 pushes."""
    data, hidden, results = (tmp_path / name for name in ("data", "truth", "results"))
    small = ["--training", "60", "--least", "60", "--most", "60", "--rows", "100", "--model", "gp", "--mean", "zero"]
    main(["make", "--out", str(data), "--truth", str(hidden), "--seed", "177", "--count", "3", "--cores", "1", *small])
    main(["run", "--data", str(data), "--out", str(results), "--cores", "1"])
    main(["oracle", "--data", str(data), "--truth", str(hidden), "--cores", "1"])
    table, scored = tmp_path / "table.md", tmp_path / "score.json"
    main(["score", "--results", str(results), "--truth", str(hidden), "--json", str(scored), "--markdown", str(table)])
    record = json.loads(scored.read_text())
    assert record["recordings"] == 3
    assert counted(record, "traces that failed") == (0, 3)
    assert counted(record, "motion model changed without cause") == (0, 2)
    assert counted(record, "harm: interval of the gain wholly above zero") == (0, 3)
    assert counted(record, "wrench-only changes reported as such") == (1, 1)
    assert "motion model changed without cause | 0 of 2" in table.read_text()

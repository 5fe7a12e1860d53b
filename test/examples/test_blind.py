"""Blind recordings: the truth stays out of the data, and the score tells right verdicts from wrong ones."""

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
    told = {
        "group": "library", "channel": "motion", "kind": "contact_friction", "names": ["contact_friction"],
        "covariates": ["slid_distance"], "size": "large", "oracle_gain": {"value": -0.5},
    }  # fmt: skip
    return {**told, **other}


def nothing() -> dict[str, Any]:
    return truth(group="none", channel="none", kind="none", names=[], covariates=[], size="none", oracle_gain=None)


def verdict(mechanism: str | None, covariate: str, **other: Any) -> dict[str, Any]:
    told = {
        "verdict": "effect", "effect_present": True, "channel": "motion", "kind": "mean", "covariates": [covariate],
        "equivalent": [], "motion_model_changed": True, "seconds": 10.0,
        "effects": [{"mechanism": mechanism, "covariate": covariate}],
        "gain": {"nlpd": {"value": -0.4, "low": -0.5, "high": -0.3}},
    }  # fmt: skip
    return {**told, **other}


def silent() -> dict[str, Any]:
    return {
        "verdict": "none", "effect_present": False, "channel": "none", "kind": None, "covariates": [], "equivalent": [],
        "motion_model_changed": False, "effects": [], "gain": {"nlpd": {"value": 0.0, "low": -0.01, "high": 0.01}},
    }  # fmt: skip


def counted(scored: dict[str, Any], what: str) -> tuple[int, int]:
    (found,) = [rate for rate in scored["rates"] if rate["what"] == what]
    return found["count"], found["of"]


def one(told: dict[str, Any], result: dict[str, Any]) -> dict[str, Any]:
    return dict(score_of({"000": told}, {"000": result})["judged"]["000"])


def test_a_right_name_with_its_driver_is_right_in_everything() -> None:
    judged = one(truth(), verdict("contact_friction", "slid_distance"))
    assert judged["found"] and judged["name"] and judged["driver"] and judged["in_set"] and judged["set_size"] == 1
    assert not (judged["wrong"] or judged["harm"] or judged["unknown"] or judged["failed"])
    assert judged["share"] == pytest.approx(0.8)


def test_a_wrong_mechanism_and_a_wrong_driver_are_told_apart() -> None:
    mechanism = one(truth(), verdict("pressure_spread", "slid_distance"))
    driver = one(truth(), verdict("contact_friction", "elapsed_time", equivalent=["slid_distance", "push_index"]))
    assert (mechanism["name"], mechanism["driver"], mechanism["wrong"]) == (False, True, True)
    assert (driver["name"], driver["driver"], driver["in_set"], driver["set_size"]) == (True, False, True, 3)


def test_silence_is_right_where_there_is_nothing_and_a_miss_elsewhere() -> None:
    scored = score_of({"000": nothing(), "001": truth(), "002": nothing()}, {
        "000": silent(), "001": silent(), "002": verdict("contact_friction", "edge"),
    })  # fmt: skip
    assert counted(scored, "false alarms on recordings without an effect") == (1, 2)
    assert counted(scored, "motion model changed without cause") == (1, 2)
    assert counted(scored, "found, mechanism in the library: large") == (0, 1)
    assert scored["judged"]["001"]["share"] == 0.0


def test_a_mechanism_that_was_taken_out_must_come_back_as_unknown() -> None:
    run = {"without": "contact_friction"}
    unknown = one(truth(), verdict(None, "slid_distance", verdict="driver_only", **run))
    named = one(truth(), verdict("pressure_spread", "slid_distance", **run))
    assert unknown["outside"] and unknown["unknown"] and unknown["name"] and not unknown["wrong"]
    assert named["outside"] and named["wrong"] and not named["unknown"]
    clock = verdict("clock_offset", "model_inputs", verdict="measurement", channel="measurement", **run)
    assert one(truth(), clock)["wrong"] and not one(truth(), clock)["found"]


def test_wrench_measurement_and_variance_have_their_own_channels() -> None:
    wrench = truth(group="wrench", channel="wrench", names=["surface_friction"], oracle_gain=None)
    told = verdict("surface_friction", "slid_distance", verdict="wrench_only", channel="wrench")
    assert one(wrench, told)["found"] and not one(wrench, verdict("contact_friction", "slid_distance"))["found"]
    clock = truth(channel="measurement", names=["clock_offset"], covariates=["model_inputs"], oracle_gain=None)
    right = verdict("clock_offset", "clock_offset", verdict="measurement", channel="measurement")
    assert one(clock, right)["name"] and one(clock, right)["in_set"]
    noisy = truth(channel="variance", names=[], oracle_gain=None)
    assert one(noisy, verdict(None, "slid_distance", verdict="variance", kind="variance"))["name"]
    assert not one(noisy, verdict("contact_friction", "slid_distance"))["name"]


def test_harm_and_failures_are_counted() -> None:
    harmful = verdict("contact_friction", "slid_distance", gain={"nlpd": {"value": 0.2, "low": 0.1, "high": 0.3}})
    failed = {"failed": "TableError: no", "without": None, "seconds": 1.0}
    scored = score_of({"000": truth(), "001": truth()}, {"000": harmful, "001": failed})
    assert counted(scored, "harm: interval of the gain wholly above zero") == (1, 2)
    assert counted(scored, "traces that failed") == (1, 2)


@pytest.mark.parametrize(("gain", "size"), [(-0.05, "small"), (-0.1, "medium"), (-0.4, "medium"), (-0.41, "large")])
def test_the_oracle_decides_what_is_large(gain: float, size: str) -> None:
    assert one(truth(oracle_gain={"value": gain}), silent())["size"] == size


def test_intervals_are_wilsons() -> None:
    assert wilson(0, 30) == pytest.approx((0.0, 0.1135), abs=1e-4)
    assert wilson(27, 30) == pytest.approx((0.7438, 0.9654), abs=1e-4)
    assert wilson(0, 0) == (0.0, 1.0)


def test_the_table_names_what_was_not_tried() -> None:
    text = markdown_of(score_of({"000": nothing()}, {"000": silent()}))
    assert "| false alarms on recordings without an effect | 0 of 1 | 0 to 79 % | at most 2 in 30 |" in text
    assert "no such recording" in text


def test_truth_and_data_may_not_lie_in_one_another(tmp_path: Path) -> None:
    apart(tmp_path / "data", tmp_path / "truth")
    for truth_folder in (tmp_path / "data", tmp_path / "data" / "truth", tmp_path):
        with pytest.raises(SystemExit, match="apart"):
            apart(tmp_path / "data", truth_folder)


def test_what_is_made_tells_nothing_of_the_truth(tmp_path: Path) -> None:
    data, hidden = tmp_path / "data", tmp_path / "truth"
    hidden.mkdir()
    drawn = make_one(3, "library", 7, SMALL, data, hidden)
    told = json.loads((hidden / "003.json").read_text())
    assert (told["kind"], told["group"], told["value"]) == (drawn.kind, "library", drawn.value)
    assert {path.relative_to(data).parts[0] for path in data.rglob("*")} == {"003"}
    assert sorted(path.name for path in (data / "003").iterdir()) == sorted([MODEL, "new"])
    recording = read_recording(data / "003" / "new")
    assert {name.strip("/") for name in recording.scalars} == {"surface/temperature", "room/humidity"}
    hints = [drawn.kind, "library", str(hidden), "medium", *(name for name in drawn.names if name)]
    for path in (data / "003" / "new").iterdir():
        assert not any(hint.encode() in path.read_bytes() for hint in hints if hint != "contact_friction"), path


def test_making_again_leaves_what_is_there(tmp_path: Path) -> None:
    call = ["make", "--out", str(tmp_path / "data"), "--truth", str(tmp_path / "truth"), "--count", "1"]
    call += ["--training", "25", "--least", "20", "--most", "22", "--rows", "40", "--model", "analytical"]
    call += ["--cores", "1"]
    main(call)
    model = tmp_path / "data" / "000" / MODEL
    before = model.stat().st_mtime_ns
    main(call)
    assert model.stat().st_mtime_ns == before


def test_groups_come_in_their_shares_and_not_in_a_fixed_order() -> None:
    groups = [[_group(seed, k) for k in range(len(CYCLE))] for seed in (1, 2)]
    assert sorted(groups[0]) == sorted(groups[1]) == sorted(CYCLE)
    assert groups[0] != groups[1]


@pytest.mark.parametrize("group", GROUPS)
def test_every_kind_can_be_drawn_and_acts(group: str) -> None:
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


def test_the_same_seed_draws_the_same_truth() -> None:
    spec = later_spec(rig_of(np.random.default_rng(2), "x", 8), np.random.default_rng(3), 8)
    assert drawn_for(spec, "library", np.random.default_rng(5)) == drawn_for(spec, "library", np.random.default_rng(5))


def test_drivers_have_the_documented_names() -> None:
    known = {"slid_distance", "elapsed_time", "push_index", "dwell_time", "velocity", "edge", "slider_x", "slider_y"}
    known |= {"push_heading", "slider_heading"}
    for driver in DRIVERS.values():
        assert all(name in known or name.startswith("topic:/") for name in driver.covariates)
    assert undisturbed().channel == "none"


def test_a_mechanism_is_out_of_the_library_only_inside() -> None:
    from push_predictor.residuals.candidates import enumeration

    with library_without("tilted_surface"):
        assert "tilted_surface" not in {mechanism.name for mechanism in enumeration.LIBRARY}
    assert enumeration.LIBRARY is LIBRARY
    with pytest.raises(SystemExit, match="perpetual"), library_without("perpetual"):
        pass


def test_a_small_run_of_all_steps_ends_in_a_table(tmp_path: Path) -> None:
    """Nothing, an effect of the library and a change of the wrench, each on 120 pushes."""
    data, hidden, results = (tmp_path / name for name in ("data", "truth", "results"))
    small = ["--training", "120", "--least", "120", "--most", "120", "--rows", "200", "--model", "gp"]
    main(["make", "--out", str(data), "--truth", str(hidden), "--seed", "177", "--count", "3", "--cores", "2", *small])
    main(["run", "--data", str(data), "--out", str(results), "--cores", "2"])
    main(["oracle", "--data", str(data), "--truth", str(hidden), "--cores", "2"])
    table, scored = tmp_path / "table.md", tmp_path / "score.json"
    main(["score", "--results", str(results), "--truth", str(hidden), "--json", str(scored), "--markdown", str(table)])
    told = json.loads(scored.read_text())
    assert told["recordings"] == 3
    assert counted(told, "traces that failed") == (0, 3)
    assert counted(told, "motion model changed without cause") == (0, 2)
    assert counted(told, "harm: interval of the gain wholly above zero") == (0, 3)
    assert counted(told, "wrench-only changes told as such") == (1, 1)
    assert "motion model changed without cause | 0 of 2" in table.read_text()

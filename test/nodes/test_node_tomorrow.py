# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A model extended on Tuesday's recording predicts Wednesday's: offline, through the services, over the validator."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hosted_nodes import hosted_node
from ros_harness import free_domain
from search_bench import in_library
from server_bench import GOOD, MANY, hosted_server_of
from validator_bench import WRITTEN, assert_same_as_offline, beginning, hosting_replay, hosting_validator

from push_predictor.evaluation.offline import validate_recording
from push_predictor.evaluation.validation import metrics_json
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.streams import Recording, WrenchStream
from push_predictor.recordings.write import write_recording
from push_predictor.residuals.trace import trace_data
from push_predictor.simulation.changes import Changes, Moment
from push_predictor.simulation.pushes import random_pushes
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.simulation.sensors import Sensors
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array

pytestmark = pytest.mark.slow

DAY = 86_400 * 10**9  # ns
ONSET, TUESDAY_PUSHES = 24, 60  # no push beside the onset is held out, so that its place is known
COUNT = ["push_index"]
CLOCK = ["push_index", "elapsed_time", "slid_distance"]


def tilting(first: int) -> Changes:
    """A pull of 0.9 N on the slider from this push on."""

    def pull(moment: Moment) -> Array:
        return np.outer(0.9 * (moment.conditions.values["push_index"] >= first), [1.0, 0.0, 0.0])

    return Changes(pull=pull)


def recording(day: int, pushes: int, changes: Changes, sensors: Sensors = Sensors()) -> Recording:
    """A recording that begins on this day; the number of the push counts from zero."""
    plan = random_pushes(pushes, (0.02,), travel=0.014, rng=np.random.default_rng(day))
    rig = {"surface_seed": 1, "slider_seed": 1, "turn_spread": 3.0}
    found = simulate(SimulationSpec("rect1", "delrin", plan, seed=day, changes=changes, sensors=sensors, **rig))
    later = 1_600_000_000 * 10**9 + day * DAY - int(found.slider.stamp[0])
    slider, pusher = (replace(s, stamp=s.stamp + later) for s in (found.slider, found.pusher))
    assert found.wrench is not None
    wrench = WrenchStream(found.wrench.stamp + later, found.wrench.fx, found.wrench.fy, found.wrench.torque)
    return replace(found, slider=slider, pusher=pusher, wrench=wrench, scalars={})


@dataclass(frozen=True)
class Week:
    """Recordings of Tuesday, in which the rig changes, and of Wednesday; the deployed model and two extended ones.

    by_count: knows the count alone. by_clock: extended by the covariates that these data cannot tell apart.
    """

    tuesday: Path
    wednesday: Path
    deployed: PushModel
    by_count: PushModel
    by_clock: PushModel


@pytest.fixture(scope="module")
def week(tmp_path_factory: pytest.TempPathFactory) -> Week:
    folder = tmp_path_factory.mktemp("week")
    few = Sensors(rate=50.0, wrench_rate=50.0)  # samples, which the nodes receive one by one
    write_recording(folder / "monday", recording(1, 40, Changes()))
    write_recording(folder / "tuesday", recording(2, TUESDAY_PUSHES, tilting(ONSET)))
    write_recording(folder / "wednesday", recording(3, 16, tilting(0), few))
    data = [folder / "monday"]
    deployed = train_model(
        load_data(data), load_rig_for(data), "analytical", name="deployed", options=TrainingOptions(fit=True)
    )
    found: list[PushModel] = []
    with pytest.MonkeyPatch.context() as patch:  # responses take most of the time
        in_library(patch, "tilted_surface", "contact_friction", "anisotropic_friction")
        for covariates in (COUNT, CLOCK):
            trace = trace_data([folder / "tuesday"], deployed, covariates=covariates)
            assert trace.extended is not None and trace.effects[0].mechanism == "tilted_surface", trace
            if covariates is CLOCK:
                assert "elapsed_time" in (trace.effects[0].covariate, *trace.equivalent)
                assert trace.terms[0].covariate == trace.effects[0].covariate  # the report shows them together
            save_model(trace.extended, folder / f"{covariates[-1]}.pushmodel")
            found.append(load_model(folder / f"{covariates[-1]}.pushmodel"))
    return Week(folder / "tuesday", folder / "wednesday", deployed, found[0], found[1])


@cache
def nmse(model: PushModel, path: Path) -> float:
    return float(metrics_json(validate_recording(model, path)[1])["nmse"]["total"])  # type: ignore[index]  # of JSON


def test_extended_model_carries_the_end_of_the_trace_and_needs_no_count(week: Week) -> None:
    assert not {*CLOCK} & {*week.by_count.needs, *week.by_clock.needs}
    assert dict(week.by_count.defaults) == {"push_index": TUESDAY_PUSHES}


def test_the_covariate_that_follows_from_the_clock_is_chosen(week: Week) -> None:
    assert list(week.by_clock.defaults) == ["elapsed_time"]
    assert 0.0 < week.by_clock.predictor.effects[0].basis.place < week.by_clock.defaults["elapsed_time"]


@pytest.mark.parametrize("which", ["by_count", "by_clock"])
def test_wednesday_is_predicted_though_its_count_begins_with_zero(week: Week, which: str) -> None:
    model: PushModel = getattr(week, which)
    assert nmse(model, week.wednesday) < 0.5 * nmse(week.deployed, week.wednesday)
    assert nmse(model, week.tuesday) < 0.5 * nmse(week.deployed, week.tuesday)  # whose counts are not added twice
    windows, comparison = validate_recording(model, week.wednesday)
    assert windows[0].covariates["push_index"] == 0.0  # as recorded
    early = comparison.push_id == comparison.push_id[0]
    assert np.abs(comparison.residuals[early]).mean() < 3.0


def test_trace_of_wednesday_goes_on_from_tuesday(week: Week) -> None:
    trace = trace_data([week.wednesday], week.by_count, covariates=COUNT)
    assert trace.analysis.covariates["push_index"].min() >= TUESDAY_PUSHES
    assert trace.extended is None


def test_requests_without_the_count_get_the_rig_as_it_is_now(week: Week) -> None:
    path = week.tuesday.parent / "push_index.pushmodel"
    with hosted_server_of([path]) as server:
        heading = {"push_heading": 0.4, "slider_heading": 0.1}
        alone, now, then = (
            server.push(covariates={**heading, **given})
            for given in ({}, {"push_index": float(TUESDAY_PUSHES)}, {"push_index": 0.0})
        )
        assert alone.success and now.success and then.success, alone.message
        assert np.array_equal(alone.mean, now.mean) and not np.allclose(alone.mean, then.mean, atol=1e-4)
        many = server.batch(MANY, covariates={name: np.full(len(MANY), value) for name, value in heading.items()})
        given = {name: np.full(len(MANY), value) for name, value in {**heading, "push_index": 60.0}.items()}
        assert many.success and many.mean == server.batch(MANY, covariates=given).mean
        listed = server.list()
        assert "push_index" not in listed.models[0].covariates
        assert f"defaults=push_index {TUESDAY_PUSHES}" in listed.descriptions[0]
        assert not server.push(GOOD).success  # the headings have no default


def test_validator_counts_on_from_tuesday(week: Week, tmp_path: Path) -> None:
    path, domain, some = week.tuesday.parent / "push_index.pushmodel", free_domain(), tmp_path / "some"
    beginning(week.wednesday, 12.0, some)
    params = {"model": path, "output": tmp_path, "report": False, "diagnostics_period": 0.2}
    with (
        hosted_node("predict_server", domain=domain, params={"models": [str(path)]}),
        hosting_validator(domain=domain, params=params) as process,
        hosting_replay(domain, recording=some, rate=8.0),
    ):
        process.wait_for_text(WRITTEN, 90.0)
    assert_same_as_offline(tmp_path, path, some)
    online = json.loads((tmp_path / "validation.json").read_text())
    assert online["nmse"]["total"] < 0.5 * nmse(week.deployed, some)

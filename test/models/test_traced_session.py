# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""An extended model carries the rig as it is now: defaults of requests, and counts that go on in later recordings."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drifting_models import extended, pushes, slippery
from synthetic import square_rig

from push_predictor.cli import main
from push_predictor.errors import RequestError
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.traced_session import Mark, TracedSession
from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Pushes
from push_predictor.models.request import check_pushes
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.train import train_model
from push_predictor.recordings.table import PushTable

SECOND, DAY = 10**9, 86_400 * 10**9
TUESDAY = 1_700_000_000 * SECOND
NAMES = ("elapsed_time", "push_index", "slid_distance")
MORNING, AFTERNOON, END = (Mark(TUESDAY + k * SECOND, *counts) for k, counts in
                           ((0, (0.0, 0.0)), (1000, (50.0, 0.5)), (2000, (90.0, 0.9))))  # fmt: skip
SESSION = TracedSession(dict(zip(NAMES, (2000.0, 90.0, 0.9), strict=True)), TUESDAY, (MORNING, AFTERNOON, END))
ONE = Pushes(0.02, 0.1, 0.85)


def recorded(began: int, *touched: float) -> PushTable:
    """A recording: pushes of two windows with these times (s) of first touch, counted from its own beginning."""
    n, touch = 2 * len(touched), np.repeat(touched, 2)
    since = np.tile([0.0, 0.2], len(touched))
    names = [
        f"push-{(began + int(t * SECOND)) // SECOND}.{(began + int(t * SECOND)) % SECOND // 10**6:03d}" for t in touch
    ]
    columns = {
        "elapsed_time": touch + since,
        "push_index": np.repeat(np.arange(len(touched), dtype=np.float64), 2),
        "slid_distance": 0.004 * np.arange(n),
        "time_since_contact": since,
    }
    inputs = np.column_stack([np.full(n, 0.02), np.linspace(0.1, 0.9, n), np.linspace(-0.5, 0.5, n)])
    return PushTable(inputs, np.full(n, 0.2), np.tile([0.004, 0.0, 0.01], (n, 1)), np.array(names), columns)


def counted(began: int, session: TracedSession = SESSION) -> list[list[float]]:
    """The cumulative covariates of the first window of each of two pushes, 5 s and 9 s after the beginning."""
    covariates = session.continued(recorded(began, 5.0, 9.0)).covariates
    return [np.round(covariates[name][[0, 2]], 6).tolist() for name in NAMES]


# --- later recordings ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("began", "counts"),
    [
        (86_400.0, [[86_405.0, 86_409.0], [90.0, 91.0], [0.9, 0.908]]),  # after the end: goes on from it
        (0.0, [[5.0, 9.0], [0.0, 1.0], [0.0, 0.008]]),  # the recording that was traced first
        (-86_400.0, [[-86_395.0, -86_391.0], [0.0, 1.0], [0.0, 0.008]]),  # from before: a time before zero
        *(  # within the session: the counts of the part that it lies in; the last goes on beyond the end
            (after, [[after + 5.0, after + 9.0], [50.0, 51.0], [0.5, 0.508]]) for after in (1000.0, 1500.0, 1998.0)
        ),
    ],
)
def test_a_later_recording_has_the_counts_of_its_place_in_the_session(began: float, counts: list[list[float]]) -> None:
    assert counted(TUESDAY + int(began * SECOND)) == counts


def test_recordings_of_one_table_are_each_placed_by_their_own_stamps() -> None:
    parts = [recorded(began, 5.0) for began in (TUESDAY, TUESDAY + DAY)]
    both = PushTable(
        np.concatenate([p.inputs for p in parts]),
        np.concatenate([p.duration for p in parts]),
        np.concatenate([p.outcomes for p in parts]),
        np.array([f"{k}.csv/{name}" for k, p in enumerate(parts) for name in p.push_id]),
        {name: np.concatenate([p.covariates[name] for p in parts]) for name in parts[0].covariates},
    )
    assert SESSION.continued(both).covariates["push_index"].tolist() == [0.0, 0.0, 90.0, 90.0]


def test_table_without_stamps_and_model_without_session_keep_all_columns() -> None:
    later = recorded(TUESDAY + DAY, 5.0)
    unnamed = replace(later, push_id=np.array(["push-1", "push-1"]))
    assert SESSION.continued(unnamed) is unnamed and TracedSession().continued(later) is later
    lacking = replace(later, covariates={name: later.covariates[name] for name in NAMES})
    assert SESSION.continued(lacking) is lacking


def test_session_of_a_second_trace_goes_on_from_the_first() -> None:
    began = TUESDAY + DAY
    own = TracedSession({"elapsed_time": 100.0, "push_index": 7.0, "slid_distance": 0.1}, began,
                        (Mark(began, 0.0, 0.0), Mark(began + 100 * SECOND, 7.0, 0.1)))  # fmt: skip
    both = SESSION.followed_by(own)
    assert both.origin == TUESDAY
    assert both.now == pytest.approx({"elapsed_time": 86_500.0, "push_index": 97.0, "slid_distance": 1.0})
    assert counted(TUESDAY + 2 * DAY, both) == [[172_805.0, 172_809.0], [97.0, 98.0], [1.0, 1.008]]
    for earlier in (began, AFTERNOON.stamp, TUESDAY):
        assert counted(earlier, both) == counted(earlier)
    assert TracedSession().followed_by(own) == own


# --- requests --------------------------------------------------------------------------------------------------------


def stepped(name: str, place: float, size: float = 0.2) -> Effect:
    basis = DriverBasis("step", (name,), place=place)
    return Effect("contact_friction", name, basis, np.array([size]), np.array([[1e-4]]), np.ones(3))


@pytest.fixture(scope="module")
def base() -> PushModel:
    table = pushes(20)
    columns = {"push_index": np.repeat(np.arange(20.0), 3), **table.covariates}
    return train_model(replace(table, covariates=columns), square_rig(), "analytical", name="deployed")


def traced(base: PushModel, *effects: Effect) -> PushModel:
    model = extended(base, *effects)
    assert isinstance(model.predictor, ExtendedPredictor)
    return replace(model, predictor=replace(model.predictor, session=SESSION))


def test_request_without_the_count_is_predicted_as_after_the_trace(base: PushModel) -> None:
    model = traced(base, stepped("push_index", 10.5))
    assert model.needs == () and dict(model.defaults) == {"push_index": 90.0}
    found, before, after = (
        model.predict(pushed_at(**given)) for given in ({}, {"push_index": 3.0}, {"push_index": 90.0})
    )
    assert np.array_equal(found.mean, after.mean) and not np.allclose(found.mean, before.mean, atol=1e-5)
    assert found.in_domain.all() and after.in_domain.all()
    with pytest.raises(RequestError, match="covariate push_index"):
        check_pushes(model, replace(base.training, covariates={"push_index": np.full(len(base.training), np.nan)}))


def pushed_at(**covariates: float) -> Pushes:
    return Pushes(0.02, 0.1, 0.85, covariates=covariates)


def test_request_with_one_of_two_counts_gets_the_default_of_the_other(base: PushModel) -> None:
    model = traced(base, stepped("push_index", 10.5, 0.05), stepped("elapsed_time", 500.0, 0.05))
    found, same = (model.predict(pushed_at(push_index=3.0, **given)).mean for given in ({}, {"elapsed_time": 2000.0}))
    assert np.array_equal(found, same) and not np.allclose(found, model.predict(pushed_at()).mean, atol=1e-5)


def test_default_of_a_growing_effect_is_in_the_domain_and_more_is_not(base: PushModel) -> None:
    model = traced(base, slippery(0.1))
    assert model.covariate_ranges["elapsed_time"].high == 2000.0  # training ends at 1000 s
    inside = [model.predict(pushed_at(**given)).in_domain[0] for given in ({}, {"elapsed_time": 2001.0})]
    assert inside == [True, False]
    mixed = traced(base, stepped("elapsed_time", 500.0), slippery(0.1))
    assert not mixed.predict(pushed_at(elapsed_time=2001.0)).in_domain[0]


def test_covariates_that_follow_from_nothing_are_still_needed(base: PushModel) -> None:
    model = traced(base, stepped("topic:/warmth", 0.0), stepped("push_index", 10.5))
    assert model.needs == ("topic:/warmth",)
    with pytest.raises(RequestError, match="covariate topic:/warmth: 'missing'"):
        model.predict(ONE)


# --- what is stated, and the file ------------------------------------------------------------------------------------


def test_info_list_models_and_repr_state_the_defaults(
    base: PushModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = traced(base, stepped("push_index", 10.5))
    save_model(model, tmp_path / "m")
    loaded = load_model(tmp_path / "m")
    assert loaded.predictor.session == SESSION
    assert "needs covariates: none\n  defaults of covariates: push_index 90\n" in repr(loaded)
    assert "defaults" not in repr(base)
    assert main(["info", str(tmp_path / "m"), "--json", "-"]) == 0
    info = json.loads(capsys.readouterr().out)
    assert (info["needs"], info["defaults"], info["time_origin"]) == ([], {"push_index": 90.0}, TUESDAY)
    registry = ModelRegistry()
    registry.load(tmp_path / "m")
    assert "covariates=-; defaults=push_index 90; " in registry.describe("deployed")

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""adapt_model through a real server: residuals in, adapted predictions, diagnostics and a file out."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
import ros_harness as harness
from diagnostic_msgs.msg import DiagnosticStatus
from drifting_models import pushes
from lifecycle_msgs.msg import Transition
from server_bench import MANY, Server, hosted_server_of
from synthetic import square_pushes, square_rig

from msg_adapters.predictions import prediction_from_response
from push_predictor.adaptation import Adaptation
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.nodes.server import adaptation
from push_predictor.recordings.table import PushTable
from push_predictor_interfaces.msg import PushResidual
from push_predictor_interfaces.srv import AdaptModel

SLICK = Effect("contact_friction", "constant", DriverBasis("constant"), np.array([-0.2]), np.zeros((1, 1)), np.ones(3))


class Rig:
    """A server that follows, and a publisher of residuals as a validator's."""

    def __init__(self, server: Server) -> None:
        self.server = server
        self._adapt = server.node.create_client(AdaptModel, "adapt_model")
        self._residuals = server.node.create_publisher(PushResidual, "push_residual", 1000)
        harness.wait_until(lambda: self._residuals.get_subscription_count() > 0, harness.START_TIMEOUT)

    def command(self, command: str, model: str = "", path: str = "") -> AdaptModel.Response:
        return harness.call(self._adapt, AdaptModel.Request(command=command, model=model, path=path))

    def publish(self, table: PushTable, model: str = "monday") -> None:
        for k, push in enumerate(table.push_id.tolist()):
            velocity, contact, angle = table.inputs[k].tolist()
            self._residuals.publish(
                PushResidual(
                    push_id=push,
                    model=model,
                    velocity=velocity,
                    contact=contact,
                    angle=angle,
                    duration=float(table.duration[k]),
                    observed=table.outcomes[k],
                )
            )

    def status(self) -> DiagnosticStatus | None:
        found = [status for status in self.server.statuses if status.name.endswith(": adaptation")]
        return found[-1] if found else None

    def values(self) -> dict[str, str]:
        status = self.status()
        return {} if status is None else {pair.key: pair.value for pair in status.values}

    def has_taken(self, count: int) -> bool:
        return harness.wait_until(lambda: self.values().get("pushes") == str(count), harness.START_TIMEOUT)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model about mechanics, and one that has learnt without."""
    place = tmp_path_factory.mktemp("models")
    save_model(train_model(pushes(60, 0), square_rig(), "analytical", name="monday"), place / "monday.pushmodel")
    blind = train_model(*square_pushes(30), "gp", name="blind", options=TrainingOptions(mean="zero"))
    save_model(blind, place / "blind.pushmodel")
    return place


@pytest.fixture(scope="module")
def following(folder: Path) -> Iterator[Rig]:
    """A server whose default model follows from the start."""
    served = [folder / "monday.pushmodel", folder / "blind.pushmodel"]
    with patch.object(adaptation, "QUIET", 0.3), hosted_server_of(served, adapt=True) as server:
        yield Rig(server)


@pytest.fixture
def rig(following: Rig) -> Rig:
    """That server, whose model has followed no push yet."""
    assert following.command("start", "monday").success and following.command("reset").success
    return following


def test_the_adapted_model_stands_beside_the_deployed_one_and_follows_the_residuals(rig: Rig, folder: Path) -> None:
    assert rig.server.list().names == ["monday", "blind", "monday_adapted"]
    deployed = prediction_from_response(rig.server.batch(MANY))
    table = pushes(20, 1, SLICK)
    rig.publish(table)
    assert rig.has_taken(20)  # the last push, too, once it is quiet
    expected = Adaptation(load_model(folder / "monday.pushmodel"))
    for push in table.pushes:
        expected.update(table.take(table.push_id == push))
    adapted = prediction_from_response(rig.server.batch(MANY, model="monday_adapted"))
    of_expected = expected.adapted.predict_rows(MANY, np.full(len(MANY), 0.2))
    np.testing.assert_allclose(adapted.mean, of_expected.mean, atol=1e-9)
    np.testing.assert_allclose(adapted.covariance, of_expected.covariance, rtol=1e-6)
    np.testing.assert_array_equal(prediction_from_response(rig.server.batch(MANY)).mean, deployed.mean)
    status, values = rig.status(), rig.values()
    assert status is not None and status.level == DiagnosticStatus.OK and status.message == str(expected)
    assert values["contact_friction"] == str(expected.parameters[0]) and values["follows"] == "true"


def test_it_stops_goes_on_starts_anew_and_is_written(rig: Rig, tmp_path: Path) -> None:
    rig.publish(pushes(6, 1, SLICK))
    assert rig.has_taken(6)
    assert rig.command("stop").success
    rig.publish(pushes(3, 2, SLICK))
    saved = rig.command("save", path=str(tmp_path / "now.pushmodel"))  # has taken what was sent before
    assert saved.success and saved.name == "monday_adapted" and "after 6 pushes" in saved.message
    now = load_model(tmp_path / "now.pushmodel").predict_rows(MANY, np.full(len(MANY), 0.2))
    adapted = prediction_from_response(rig.server.batch(MANY, model="monday_adapted"))
    np.testing.assert_allclose(now.mean, adapted.mean, atol=1e-9)
    assert "after 6 pushes" in rig.command("start", "monday").message  # goes on
    assert rig.command("reset").message == "no parameter has certainly changed, after 0 pushes"
    again = prediction_from_response(rig.server.batch(MANY, model="monday_adapted"))
    np.testing.assert_allclose(again.mean, prediction_from_response(rig.server.batch(MANY)).mean, atol=1e-9)


def test_residuals_of_other_models_and_bad_ones_change_nothing(rig: Rig) -> None:
    rig.publish(pushes(5, 1, SLICK), model="another")
    bad = pushes(1, 3)
    bad.outcomes[1, 0] = np.nan
    rig.publish(bad)
    rig.publish(pushes(2, 2))
    assert rig.has_taken(2)
    assert rig.values()["refused"] == "-"
    rig.publish(bad)
    refused = f"{bad.pushes[0]}: observed: [nan, "
    assert harness.wait_until(lambda: rig.values()["refused"].startswith(refused), harness.START_TIMEOUT)
    status = rig.status()
    assert status is not None and status.level == DiagnosticStatus.WARN and rig.values()["pushes"] == "2"


def test_commands_that_cannot_be_done_are_refused_by_name(rig: Rig, tmp_path: Path) -> None:
    assert "command: 'go' is not accepted, give one of start" in rig.command("go").message
    assert "model: 'blind' is not accepted, give a model about mechanics" in rig.command("start", "blind").message
    assert rig.command("start", "nobody").error_code == AdaptModel.Response.UNKNOWN_MODEL
    assert "path: '' is not accepted, give the path of a model file" in rig.command("save").message
    assert "path: " in rig.command("save", path=str(tmp_path)).message
    assert rig.command("stop").success  # what followed before still does


def test_nothing_follows_without_the_parameter_nor_once_the_models_are_unloaded(folder: Path) -> None:
    with hosted_server_of([folder / "monday.pushmodel"]) as server:
        rig = Rig(server)
        assert rig.command("stop").error_code == AdaptModel.Response.NOT_ACTIVE and rig.status() is None
        assert rig.command("start").name == "monday_adapted"
        for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP):
            assert server.change(transition)
        assert not rig.command("reset").success
        assert server.change(Transition.TRANSITION_CONFIGURE) and server.list().names == ["monday"]
        assert server.load(folder / "monday.pushmodel", name="monday_adapted").success
        assert "one beside which no monday_adapted is loaded" in rig.command("start").message


def test_a_default_model_that_cannot_follow_is_reported_and_predicts(folder: Path) -> None:
    with hosted_server_of([folder / "blind.pushmodel"], adapt=True) as server:
        assert server.push().success
        server.process.wait_for_text("adapt: model: 'blind' is not accepted, give a model about mechanics")

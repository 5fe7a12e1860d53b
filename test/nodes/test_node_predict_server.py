# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""predict_server as a process: predictions, refusals, start and end."""

from __future__ import annotations

import signal
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import ros_harness as harness
from hosted_nodes import hosted_node
from lifecycle_msgs.msg import Transition
from rclpy.action import ActionClient
from rclpy.qos import QoSProfile
from server_bench import GOOD, MANY, hosted_server_of, server_of
from service_msgs.msg import ServiceEventInfo
from synthetic import square_pushes, square_rig

from msg_adapters.predictions import PushQuery, prediction_from_response, query_to_batch_request, query_to_request
from push_predictor.errors import RequestError
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.store.table_cache import load_served
from push_predictor.models.tabulated.tabulated_model import tabulate
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.nodes import predict_server
from push_predictor.nodes.server import services
from push_predictor.planning.given_earlier import EarlierWindows, given_earlier
from push_predictor.planning.persistence import Persistence
from push_predictor.recordings.table import empty_table
from push_predictor_interfaces.action import TraceResidual
from push_predictor_interfaces.srv import LoadModel, PredictPush, PredictPushBatch

CORNERS = np.array([[0.04, 0.04, 0.25], [-0.04, 0.04, 0.25], [-0.04, -0.04, 0.25], [0.04, -0.04, 0.25]])
CONFIG = harness.REPOSITORY / "config" / "predict_server.yaml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Three good model files and a damaged one."""
    place = tmp_path_factory.mktemp("models")
    table, rig = square_pushes(60)
    for kind in ("analytical", "gp", "vhgp"):
        save_model(
            train_model(table, rig, kind, name=kind, options=TrainingOptions(mean="zero")), place / f"{kind}.model"
        )
    whole = (place / "gp.model").read_bytes()
    (place / "damaged.model").write_bytes(whole[: len(whole) // 2])
    return place


@pytest.fixture(scope="module")
def server(folder):
    """One server with three models, gp the default, for all tests that do not change it."""
    models = [folder / f"{kind}.model" for kind in ("analytical", "gp", "vhgp")]
    with hosted_server_of(models, default_model="gp") as running:
        assert running.state() == "active"
        yield running


# --- predictions ------------------------------------------------------------------------------------------------


def test_serves_a_model_that_was_trained_on_no_push(tmp_path):
    model = train_model(empty_table(), replace(square_rig(), support_points=CORNERS), "prior", name="prior")
    few_draws = replace(model.predictor, draws=model.predictor.draws[:2])  # for a table in little time
    save_model(replace(model, predictor=few_draws), tmp_path / "prior.model")
    with hosted_server_of([tmp_path / "prior.model"]) as running:
        assert "windows=0; covariates=-; defaults=-; duration=any" in running.list().descriptions[0]
        assert running.push([0.02, 0.1, 0.2], duration=0.7).success
        assert not running.push([0.5, 0.1, 0.2]).in_domain
        answered = prediction_from_response(running.batch(MANY))
    expected = load_served(tmp_path / "prior.model").predict_rows(MANY, np.full(len(MANY), 0.2))
    np.testing.assert_allclose(answered.covariance, expected.covariance, rtol=1e-9)


def test_tables_are_computed_while_the_server_answers(folder, tmp_path, monkeypatch):
    """They change predictions by no more than their tolerance, and push and batch agree."""
    monkeypatch.setenv("PUSH_PREDICTOR_CACHE", str(tmp_path))
    outside = [0.3, 0.1, 1.4]
    with hosted_server_of([folder / "vhgp.model"]) as running:
        first = prediction_from_response(running.push(MANY[0]))
        running.next_status(lambda s: "table of" in {p.key: p.value for p in s.values}["answers"])
        after = prediction_from_response(running.push(MANY[0]))
        exact = prediction_from_response(running.batch(np.array([outside])))
        single = prediction_from_response(running.push(outside))
    assert np.max(np.abs(after.mean - first.mean) / first.std) < 1e-3
    assert np.max(np.abs(single.mean - exact.mean) / exact.std) < 1e-3
    assert np.array_equal(single.in_domain, exact.in_domain) and not single.in_domain[0]
    assert len(list(tmp_path.glob("*.tables"))) == 1


@pytest.mark.parametrize("kind", ["analytical", "gp", "vhgp"])
def test_responses_equal_the_models_predictions(server, folder, kind):
    model = tabulate(load_model(folder / f"{kind}.model"))
    expected = model.predict_rows(MANY, np.full(len(MANY), 0.2))
    answered = prediction_from_response(server.batch(MANY, model=kind))
    for k, push in enumerate(MANY):
        single = prediction_from_response(server.push(push, model=kind))
        for name in ("mean", "covariance", "process_covariance", "in_domain"):
            np.testing.assert_allclose(getattr(answered, name), getattr(expected, name), rtol=1e-12, atol=1e-18)
            np.testing.assert_allclose(getattr(single, name)[0], getattr(expected, name)[k], rtol=1e-8, atol=1e-14)


def test_residuals_of_several_windows_count_by_their_distance(folder, monkeypatch):
    """As EarlierWindows counts them, the oldest first and farthest away."""
    persistence = Persistence(np.full(3, 0.2), np.array([0.6, 0.3, 0.0]), np.array([4e-3, 8e-3, 1e-3]))
    monkeypatch.setattr(services, "persistence_of", lambda model: persistence)
    registry = ModelRegistry()
    registry.load(folder / "gp.model")
    plain, residuals = answered(registry, None), np.array([[4e-5, 0.0, 1e-3], [-1e-5, 2e-5, 0.0]])
    both = replace(plain, mean=plain.mean.repeat(2, 0), covariance=plain.covariance.repeat(2, 0))
    earlier = EarlierWindows(both, both.mean + residuals, GOOD[0] * 0.2 * np.array([2.0, 1.0]))
    expected, found = given_earlier(plain, earlier, persistence), answered(registry, residuals)
    np.testing.assert_allclose(found.mean, expected.mean, rtol=1e-9)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-9, atol=1e-20)
    assert not np.allclose(found.mean, answered(registry, residuals[::-1]).mean, rtol=1e-6)


def answered(registry, residual):
    """The prediction of the usual push, given the residual of the window before."""
    response = PredictPush.Response()
    services.handle_predict_push(registry, query_to_request("gp", GOOD, 0.2, None, residual), response)
    return prediction_from_response(response)


def test_unneeded_covariates_change_nothing(server):
    assert list(server.push(covariates={"temperature": 300.0}).mean) == list(server.push().mean)
    response = server.push(covariates={"temperature": np.nan})
    assert not response.success
    assert response.message.startswith("covariate temperature: nan")


def test_unexpected_exception_becomes_a_logged_refusal(folder, monkeypatch):
    def broken(registry, request, response):
        response.mean[0] = 1.0
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(predict_server, "handle_predict_push", broken)
    with hosted_server_of([folder / "gp.model"]) as server:
        response = server.push()
        assert not response.success and not np.any(response.mean)
        assert "internal error" in response.message and "a bug" in response.message
        assert 'in broken\n    raise ZeroDivisionError("a bug")' in server.process.text()


def test_first_request_after_start_gets_a_prediction_and_a_signal_ends_the_node(folder):
    """The response is a prediction, not the refusal of an inactive node; the exit status is 0.

    On a busy machine `call` may have to ask again, a limit of the middleware: it waits 0.1 s for a client to be known.
    """
    domain = harness.free_domain()
    with harness.ros_context(domain) as node:
        client = node.create_client(PredictPush, "predict_push", qos_profile=QoSProfile(depth=100))
        params = {"models": [str(folder / "gp.model")]}
        with harness.node_process("predict_server", domain=domain, params=params) as process:
            end = time.monotonic() + harness.START_TIMEOUT
            while not client.service_is_ready() and time.monotonic() < end:
                time.sleep(0.002)
            response = harness.call(client, query_to_request("", GOOD, 0.2))
            assert response.success, response.message
            assert process.stop(signal.SIGTERM) == 0
            assert "Traceback" not in process.text()


def test_long_batch_stops_when_the_node_ends(folder):
    registry = ModelRegistry()
    registry.load(folder / "analytical.model")
    inputs = np.tile(GOOD, (3 * services.CHUNK, 1))
    asked = []

    def go_on():
        asked.append(len(asked))
        if len(asked) == 2:
            raise KeyboardInterrupt

    request = query_to_batch_request(PushQuery("", inputs, 0.2, {}))
    with pytest.raises(KeyboardInterrupt):
        services.handle_predict_push_batch(go_on, registry, request, PredictPushBatch.Response())
    assert len(asked) == 2


def test_rejects_too_many_pushes_without_a_table(folder):
    registry = ModelRegistry()
    registry.load(folder / "analytical.model")
    request = query_to_batch_request(PushQuery("", np.tile(GOOD, (services.MAX_EXACT + 1, 1)), 0.2, {}))
    with pytest.raises(RequestError, match="50001 pushes without a table"):
        services.handle_predict_push_batch(lambda: None, registry, request, PredictPushBatch.Response())


# --- models -----------------------------------------------------------------------------------------------------


def test_list_models_describes_the_training_data(server, folder):
    models = server.list()
    assert list(models.names) == ["analytical", "gp", "vhgp"]
    assert models.default_model == "gp"
    described = dict(pair.split("=", 1) for pair in models.descriptions[2].split("; "))
    assert described == {
        "kind": "vhgp",
        "outline": "rect1",
        "surface": "abs",
        "pushes": "20",
        "windows": "60",
        "covariates": "-",
        "defaults": "-",
        "duration": "0.2",
        "speeds": "20..20 mm/s",
        "mean": "zero",
        "file": str(folder / "vhgp.model"),
    }


def test_folder_is_loaded_and_its_damaged_file_is_reported(folder, tmp_path):
    absent = tmp_path / "absent.model"
    with hosted_server_of([folder, absent, folder / "damaged.model"]) as server:
        assert list(server.list().names) == ["analytical", "gp", "vhgp"]
        status, values = server.next_status()
        assert status.level == b"\1"
        for problem in (str(absent), str(folder / "damaged.model")):
            assert problem in values["problems"]
            assert problem in server.process.text()
        assert server.push().success


def test_node_without_a_model_reports_it_and_accepts_one_later(folder):
    with hosted_server_of([folder / "damaged.model"]) as server:
        assert server.state() == "inactive" and not server.change(Transition.TRANSITION_ACTIVATE)
        refusal = server.push()
        assert not refusal.success
        assert "no model is loaded" in refusal.message
        status, _ = server.next_status()
        assert status.level == b"\2"
        assert "no model is loaded" in status.message
        assert server.load(folder / "vhgp.model").success
        assert server.state() == "active"
        assert server.push().success


def test_only_a_good_file_replaces_a_loaded_model(folder, tmp_path):
    table, rig = square_pushes(40, seed=1)
    save_model(train_model(table, rig, "analytical", name="gp"), tmp_path / "other.model")
    foreign = tmp_path / "notes.txt"
    foreign.write_text("not a model\n")
    served, new = tmp_path / "served.model", (tmp_path / "other.model").read_bytes()
    served.write_bytes((folder / "gp.model").read_bytes())
    with hosted_server_of([served], default_model="gp") as server:
        before = list(server.push().mean)
        for written in (0, len(new) // 2, len(new) - 1):  # in place, as an unfinished copy
            served.write_bytes(new[:written])
            assert list(server.push().mean) == before and not server.load(served, name="gp").success
        served.write_bytes(new)
        for bad in (folder / "damaged.model", foreign, tmp_path / "absent", tmp_path, ""):
            response = server.load(bad, name="gp")
            assert not response.success
            assert (str(bad) or "path") in response.message
            assert list(server.push().mean) == before
        assert server.load(tmp_path / "other.model").name == "gp"
        assert list(server.push().mean) != before
        assert "kind=analytical" in server.list().descriptions[0]
        assert list(server.list().names) == ["gp"]


def test_pushes_are_answered_while_their_model_is_replaced(folder):
    with hosted_server_of([folder / "vhgp.model"]) as server:
        client = server._clients["load_model"]
        expected = list(server.push().mean)
        for _ in range(2):
            loading = client.call_async(LoadModel.Request(path=str(folder / "vhgp.model")))
            while not loading.done():
                response = server.push()
                assert response.success, response.message
                assert list(response.mean) == expected
            assert loading.result().success


def test_a_missing_default_is_not_replaced_and_a_loaded_model_can_become_the_default(folder):
    with hosted_server_of([folder / "gp.model"], default_model="newer") as server:
        refused = server.push()
        assert not refused.success
        assert refused.message == "default_model: 'newer' is not accepted, give one of gp"
        assert server.next_status()[0].level == b"\1"
        assert server.set("default_model", "gp").successful
        first = list(server.push().mean)
        assert first == list(server.push(model="gp").mean)
        assert server.load(folder / "vhgp.model", name="new").name == "new"
        assert server.list().default_model == "gp"
        assert list(server.push().mean) == first
        assert server.load(folder / "vhgp.model", name="newer", make_default=True).success
        assert server.list().default_model == "newer"
        assert list(server.push().mean) == list(server.push(model="new").mean) != first
        assert server.set("default_model", "gp").successful
        assert list(server.push().mean) == first


# --- life cycle, parameters, diagnostics ------------------------------------------------------------------------


def test_only_an_active_node_answers_requests_and_accepts_goals(folder):
    with hosted_server_of([folder / "gp.model"], autostart=False) as server:
        accepted = _goal_client(server)
        assert server.state() == "unconfigured" and not accepted()
        assert server.change(Transition.TRANSITION_CONFIGURE)
        for step in (None, Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_DEACTIVATE):
            if step is not None:
                assert server.change(step)
            active = step == Transition.TRANSITION_ACTIVATE
            assert server.push().success == server.batch(MANY).success == active
            assert accepted() == active
            assert list(server.list().names) == ["gp"]
        refused = server.push()
        assert refused.message == "the node is inactive: activate it" and refused.error_code == refused.NOT_ACTIVE
        assert "the node is inactive" in server.process.text()
        assert server.change(Transition.TRANSITION_CLEANUP)
        assert server.change(Transition.TRANSITION_CONFIGURE)
        assert server.change(Transition.TRANSITION_ACTIVATE)
        assert server.push().success
        for impossible in (Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_CLEANUP, 99):
            assert not server.change(impossible) and server.state() == "active"
            assert f"transition: {impossible} is not accepted in state 'active'" in server.process.text()
        assert server.push().success
        assert server.change(Transition.TRANSITION_ACTIVE_SHUTDOWN)
        assert server.state() == "finalized" and not accepted()
        assert "goal rejected, the node is finalized" in server.process.text()


def _goal_client(server):
    """Whether a goal of trace_residual without data is accepted, as a function."""
    client = ActionClient(server.node, TraceResidual, "trace_residual")
    harness.acquaint(server.node, "push_predictor")

    def accepted():
        sent = harness.in_spin(server.node, lambda: client.send_goal_async(TraceResidual.Goal()))
        assert harness.wait_until(sent.done)
        return sent.result().accepted

    return accepted


def test_cleanup_forgets_loaded_models_and_a_default_set_since_the_start(folder):
    with hosted_server_of([folder / "gp.model"], default_model="gp") as server:
        assert server.load(folder / "analytical.model", make_default=True).success
        assert server.list().default_model == "analytical"
        for step in ("DEACTIVATE", "CLEANUP", "CONFIGURE", "ACTIVATE"):
            assert server.change(getattr(Transition, f"TRANSITION_{step}"))
        listed = server.list()
        assert (list(listed.names), listed.default_model) == (["gp"], "gp")
        assert server.push().success and not server.set("default_model", "analytical").successful


def test_what_is_read_only_or_no_model_is_refused_with_a_reason(server):
    for name, value in {"models": ["elsewhere"], "diagnostics_period": 5.0}.items():
        result = server.set(name, value)
        assert not result.successful and name in result.reason, result.reason
    assert "'nobody' is not accepted, give one of analytical, gp, vhgp" in server.set("default_model", "nobody").reason
    assert server.list().default_model == "gp"


def test_diagnostics_count_answered_and_refused_requests(server):
    _, before = server.next_status()
    server.push()
    server.push([np.nan, 0.1, 0.1])
    tabulated, refused = int(before["requests_served"]) + 1, int(before["requests_refused"]) + 1
    status, values = server.next_status(
        lambda s: {p.key: p.value for p in s.values}["requests_refused"] == str(refused)
    )
    assert status.level == b"\0"
    assert (status.name, status.hardware_id) == ("/push_predictor: predictions", "gp")
    assert values["requests_served"] == str(tabulated)
    assert values["last_refusal"].startswith("velocity: nan")
    assert values["models"] == "analytical, gp, vhgp"
    assert values["default_model"] == "gp"
    assert 0.0 < float(values["callback_p50_us"]) <= float(values["callback_p99_us"])


def test_introspection_publishes_requests_when_enabled(server):
    events = []
    server.node.create_subscription(
        PredictPush.Event, "predict_push/_service_event", lambda m: events.append(m), QoSProfile(depth=100)
    )
    assert server.set("introspection", "contents").successful
    harness.wait_for_publisher(server.node, "/predict_push/_service_event")
    push = np.array([0.0201, 0.1, 0.2])

    def shown() -> bool:
        server.push(push)
        return any(e.info.event_type == ServiceEventInfo.REQUEST_RECEIVED and e.request for e in events)

    assert harness.wait_until(shown, 60.0)
    assert any(e.request and e.request[0].velocity == push[0] for e in events)
    assert server.set("introspection", "disabled").successful

    def quiet() -> bool:
        before = len(events)
        time.sleep(0.3)
        return len(events) == before

    assert harness.wait_until(quiet)  # events of the last requests arrive after their responses
    events.clear()
    server.push(push)
    time.sleep(0.5)
    assert not events


def test_the_shipped_configuration_in_a_namespace_serves_the_shipped_model_and_warns_that_it_is_simulated():
    domain = harness.free_domain()
    arguments = ("--params-file", str(CONFIG), "-p", "models:=['default']")
    running = hosted_node("predict_server", *arguments, domain=domain, namespace="/cell1")
    with running as process, harness.ros_context(domain) as node:
        client = node.create_client(PredictPush, "/cell1/predict_push")
        assert harness.call(client, query_to_request("simulated_square_abs", GOOD, 0.2)).success
        assert "simulated square" in process.text()


def memory_kb(process) -> int:
    lines = Path(f"/proc/{process.pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))


@pytest.mark.long
def test_memory_does_not_grow(folder):
    with server_of([folder / "analytical.model"]) as server:
        assert_constant_memory(server)


def assert_constant_memory(server):
    bad = np.full(3, np.nan)

    def calls(count: int) -> None:
        for k in range(count):
            assert server.push(GOOD if k % 10 else bad, model="analytical").success == bool(k % 10)

    calls(2500)  # the statistics have reached their full size by then
    start = memory_kb(server.process)
    calls(2000)
    grown = memory_kb(server.process) - start
    assert grown < 1024, f"{grown} kB"

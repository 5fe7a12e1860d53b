# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_validator as a process: it subscribes to topics, calls a server and writes scores."""

from __future__ import annotations

import json
import math
import shutil
import signal
from collections.abc import Iterator
from operator import attrgetter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped, WrenchStamped
from hosted_nodes import HostedNode, hosted_node, refused_start
from made_up_windows import made_up_windows
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rclpy.serialization import deserialize_message
from replay_bags import RIG
from ros_harness import (
    REPOSITORY,
    NodeProcess,
    acquaint,
    call,
    free_domain,
    node_process,
    reserved_domain,
    ros_context,
    wait_until,
)
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState
from synthetic import rows, square_rig, wrench_rows
from validator_bench import (
    CIRCLE,
    HEXAGON,
    NO_SERVER,
    PLAYING_ALONE,
    WRITTEN,
    Status,
    assert_same_as_offline,
    beginning,
    finish,
    hosting_replay,
    hosting_validator,
    play_some,
    replaying,
    windows_of,
)
from visualization_msgs.msg import Marker, MarkerArray

from msg_adapters import ns_to_stamp
from msg_adapters.rigs import rig_to_message
from push_predictor.evaluation.offline import validate_recording
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.nodes import push_validator
from push_predictor.nodes.validator import results
from push_predictor.nodes.validator.results import ResultWriter
from push_predictor.nodes.validator.validation_run import ValidationRun
from push_predictor.online import session
from push_predictor.online.stream_health import Samples
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.rig import rig_from_record, save_rig
from push_predictor.recordings.windows.finder import find_windows
from push_predictor_interfaces.msg import PushResidual, PushRig
from push_predictor_interfaces.srv import LoadModel, Pause, PredictPush, Resume, Seek, SetRate

pytestmark = pytest.mark.slow

TWO_PUSHES = 900  # messages from the begin of a recording of the hexagon
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture(scope="module")
def hexagon(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three pushes of the recording of the hexagon: 5 s, 15 windows."""
    return beginning(HEXAGON, 5.2, tmp_path_factory.mktemp("recordings") / "hexagon")


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Files of two models of the hexagon, tested here on their own training pushes, which does not matter."""
    folder, data = tmp_path_factory.mktemp("models"), [HEXAGON]
    table, rig = load_data(data), load_rig_for(data)
    for kind in ("gp", "analytical"):
        save_model(
            train_model(table, rig, kind, name=kind, options=TrainingOptions(n_train=30, mean="zero")),
            folder / f"{kind}.pushmodel",
        )
    return {kind: folder / f"{kind}.pushmodel" for kind in ("gp", "analytical")}


@pytest.fixture
def domain() -> int:
    return free_domain()


@pytest.fixture(scope="module")
def served(models: dict[str, Path]) -> Iterator[int]:
    """A domain with a server of both models, for all tests that leave it as it is."""
    params = {"models": list(map(str, models.values()))}
    with reserved_domain() as domain, hosted_node("predict_server", domain=domain, params=params):
        yield domain


def validator(domain: int, *ros_args: str, **params: Any) -> Any:
    """In a process of its own, without those of its alarm and its check of the samples."""
    params = {"report": False, "diagnostics_period": 0.2, **params}
    return node_process("push_validator", *ros_args, domain=domain, params=params, coarse=True)


def hosted(domain: int, *ros_args: str, namespace: str | None = None, **params: Any) -> Any:
    """In this process."""
    params = {"report": False, "diagnostics_period": 0.2, **params}
    return hosting_validator(*ros_args, domain=domain, namespace=namespace, params=params)


# --- online is offline -----------------------------------------------------------------------------------------------


class Listener:
    """Everything published during a validation."""

    def __init__(self, node: Any) -> None:
        self.residuals: list[PushResidual] = []
        self.markers: list[MarkerArray] = []
        node.create_subscription(PushResidual, "push_residual", self.residuals.append, 1000)
        node.create_subscription(MarkerArray, "push_markers", self.markers.append, 1000)
        self.status = Status(node)


@pytest.fixture(scope="module")
def watched(
    served: int, models: dict[str, Path], hexagon: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Listener]:
    """Output folder and messages of one recording, replayed at rate 10 and validated for two models."""
    out = tmp_path_factory.mktemp("watched")
    gp, analytical = models.values()
    with ros_context(served) as node:
        received = Listener(node)
        with hosted(served, model=gp, compare=[str(analytical)], output=out) as process:
            received.status.wait_for_first()
            with hosting_replay(served, recording=hexagon, rate=10.0):
                process.wait_for_text(WRITTEN, 60.0)
            judged = [len(windows_of(out, suffix)) for suffix in ("", "_analytical")]
            assert wait_until(lambda: len(received.residuals) >= sum(judged) and len(received.markers) >= judged[0])
            received.status.wait_for("state", "waiting for samples")
            assert process.stop() == 0, process.text()
    return out, received


def test_a_replay_at_rate_10_gives_the_result_of_reading_the_recording(watched, models: dict[str, Path], hexagon: Path):
    out, _ = watched
    assert_same_as_offline(out, models["gp"], hexagon)
    assert_same_as_offline(out, models["analytical"], hexagon, suffix="_analytical")


def test_publishes_every_residual_with_the_numbers_of_the_log(watched):
    out, received = watched
    logged = [
        (name, w) for name, suffix in (("gp", ""), ("analytical", "_analytical")) for w in windows_of(out, suffix)
    ]
    published = {(m.model, m.push_id, m.window): m for m in received.residuals}
    assert len(received.residuals) == len(published) == len(logged)
    for name, entry in logged:
        message = published[name, entry["push_id"], entry["window"]]
        for field in ("velocity", "contact", "angle", "duration"):
            assert getattr(message, field) == entry[field]
        for field in ("predicted", "covariance", "observed"):
            assert list(getattr(message, field)) == entry[field]
        assert list(message.standardised) == pytest.approx(entry["standardised"], rel=1e-9)
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == entry["end"]


def test_running_scores_end_at_those_of_the_result(watched):
    out, received = watched
    for name, suffix in (("gp", ""), ("analytical", "_analytical")):
        result, values = json.loads((out / f"validation{suffix}.json").read_text()), received.status.values
        assert values[f"{name} windows"] == str(result["n_test"])
        assert values[f"{name} pushes"] == str(result["n_pushes"])
        assert float(values[f"{name} nmse"]) == pytest.approx(result["nmse"]["total"], rel=1e-5)
        assert float(values[f"{name} nlpd"]) == pytest.approx(result["nlpd"]["total"], rel=1e-5)
        for level, shares in result["coverage"].items():
            for output, share in shares.items():
                assert float(values[f"{name} coverage {level} {output}"]) == pytest.approx(share, abs=1e-5)
    running = [int(values["gp windows"]) for _, _, values in received.status.all if "gp windows" in values]
    assert running == sorted(running)


def test_the_ellipse_of_a_window_is_centred_at_the_prediction(watched, models: dict[str, Path], hexagon: Path):
    _, received = watched
    windows, comparison = validate_recording(load_model(models["gp"]), hexagon)
    by_end = {window.end: k for k, window in enumerate(windows)}
    assert len(received.markers) == len(windows)
    for array in received.markers:
        markers = {marker.ns: marker for marker in array.markers}
        assert len(markers) == len(array.markers) == 12
        stamp = array.markers[0].header.stamp
        k = by_end[stamp.sec * 10**9 + stamp.nanosec]
        for marker in array.markers:
            assert (marker.header.frame_id, marker.action, marker.color.a > 0.0) == ("world", Marker.ADD, True)
            assert marker.pose.orientation.w == 1.0
        centre = np.mean([(p.x, p.y) for p in markers["predicted_ellipse"].points[:-1]], axis=0)
        c, s, mean = math.cos(windows[k].push_heading), math.sin(windows[k].push_heading), comparison.mean[k]
        expected = windows[k].slider_start[:2] + [c * mean[0] - s * mean[1], s * mean[0] + c * mean[1]]
        assert np.allclose(centre, expected, rtol=0.0, atol=1e-9)
        observed = markers["observed_centre"].pose.position
        assert np.allclose([observed.x, observed.y], windows[k].slider_end[:2], rtol=0.0, atol=1e-9)


def test_our_reader_and_rosbags_read_the_bag_of_residuals(watched):
    out, received = watched
    bag = open_bag(out / "residuals")
    assert bag.topics == {"/push_residual": "push_predictor_interfaces/msg/PushResidual"}
    ours = [deserialize_message(message.data, PushResidual) for message in bag.messages()]
    key = attrgetter("model", "push_id", "window")
    assert sorted(ours, key=key) == sorted(received.residuals, key=key)
    ends = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in ours]
    assert ends == sorted(ends)
    with AnyReader([out / "residuals"], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        theirs = [reader.deserialize(data, connection.msgtype) for connection, _, data in reader.messages()]
    assert [(m.model, m.push_id, m.window) for m in theirs] == [key(m) for m in ours]
    assert [m.predicted.tolist() for m in theirs] == [list(m.predicted) for m in ours]


def test_residuals_name_the_frame_of_the_poses(models: dict[str, Path], tmp_path: Path):
    used, shown = {"analytical": load_model(models["analytical"])}, list[tuple[Any, ...]]()
    run = ValidationRun(square_rig(), used, SimpleNamespace(), lambda *each: shown.append(each), lambda: "lab")
    number = run.validation.add(window := made_up_windows(1)[0])
    response = PredictPush.Response(success=True, mean=window.displacement, covariance=np.eye(3).ravel())
    run._take(0, number, response)
    assert shown[0][-1].header.frame_id == "lab"
    run.write(tmp_path)
    messages = open_bag(tmp_path / "residuals").messages()
    (kept,) = [deserialize_message(message.data, PushResidual) for message in messages]
    assert kept == shown[0][-1]


def test_waits_for_a_stream_that_lags_by_a_minute_of_the_recording(models: dict[str, Path], tmp_path: Path):
    """At rate 100 a minute passes in 0.6 s, a delay that the middleware may have on a busy machine."""
    recording = read_recording(beginning(REPOSITORY / "bags" / "square_abs_test", 75.0, tmp_path / "bag"))
    assert recording.rig is not None and recording.wrench is not None
    asked: list[PredictPush.Request] = []
    client = SimpleNamespace(ask=lambda request, on_answer: asked.append(request))
    run = ValidationRun(
        recording.rig, {"analytical": load_model(models["analytical"])}, client, lambda *shown: None, lambda: "world"
    )
    stamps = [stream.stamp for stream in (recording.slider, recording.pusher, recording.wrench)]
    early, late = stamps[0][0] + 70 * 10**9, stamps[0][0] + 10 * 10**9

    def portion(start: int, wrench_start: int, end: int, wrench_end: int) -> Samples:
        inside = [(s >= begin) & (s < stop) for s, begin, stop in zip(
            stamps, (start, start, wrench_start), (end, end, wrench_end), strict=True)]  # fmt: skip
        return Samples(
            rows(recording.slider, inside[0]),
            rows(recording.pusher, inside[1]),
            wrench_rows(recording.wrench, inside[2]),
        )

    for samples in (
        portion(0, 0, early, late),
        portion(early, late, early + 1, early),
        portion(early + 1, early, 2**62, 2**62),
    ):
        run.feed(samples)
    assert run.coverage is None
    run.finish()
    assert run.coverage == []  # some twenty pushes on all sides
    expected = find_windows(recording, recording.rig)
    assert [(w.push_id, w.index) for w in run.validation.windows] == [(w.push_id, w.index) for w in expected]
    assert [r.velocity for r in asked] == pytest.approx([w.velocity for w in expected], rel=1e-9)


# --- a server that is not there, or will not answer ------------------------------------------------------------------


class Bench:
    """A validator that runs for several tests, what it publishes, and its output folder."""

    def __init__(self, domain: int, node: Node, process: NodeProcess | HostedNode, output: Path) -> None:
        self.domain, self.node, self.process, self.output = domain, node, process, output
        self.received = Listener(node)
        self.status = self.received.status
        self.log: list[str] = []
        node.create_subscription(Log, "/rosout", lambda entry: self.log.append(entry.msg), 100)

    @property
    def results(self) -> int:
        """How often it has written its result."""
        return sum(WRITTEN in text for text in self.log)

    def wait_for_result(self, number: int, timeout: float = 60.0) -> None:
        """Wait until it has written this many results."""
        assert wait_until(lambda: self.results >= number, timeout), self.log


@pytest.fixture(scope="class")
def alone(models: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """A validator without a server."""
    output = tmp_path_factory.mktemp("alone")
    params = {"model": models["gp"], "output": output, "request_timeout": 0.5, "last_answers": 120.0}
    with reserved_domain() as domain, ros_context(domain) as node, hosted(domain, **params) as process:
        yield Bench(domain, node, process, output)


class StubServer:
    """A predict_push whose answer depends on the number of the request. It offers no list_models."""

    def __init__(self, node: Any) -> None:
        self.asked = 0
        self.service = node.create_service(PredictPush, "predict_push", self._answer)

    def _answer(self, request: PredictPush.Request, response: PredictPush.Response) -> PredictPush.Response:
        self.asked += 1
        if self.asked <= 3:
            response.message = "the node is inactive: activate it"
            response.error_code = PredictPush.Response.NOT_ACTIVE  # the server's state: the validator asks again
            return response
        response.success, response.mean = True, [0.004, 0.0, 0.0]
        response.covariance = [1e-6, 0.0, 0.0, 0.0, 1e-6, 0.0, 0.0, 0.0, 1e-3]
        kind = self.asked % 10
        if kind == 0:
            response.mean = [math.nan, 0.0, 0.0]
        elif kind == 1:
            response.covariance = [0.0] * 9
        elif kind == 2:
            response = PredictPush.Response(
                success=False, message="angle: 1.6 is not accepted, give less", error_code=2
            )
        return response


class TestOtherServers:
    """Runs of one validator of a model file, each with another server."""

    def test_a_server_started_after_the_replay_costs_no_window(self, alone: Bench, models, hexagon: Path):
        before = alone.results
        alone.status.wait_for_message(NO_SERVER)
        with hosting_replay(alone.domain, recording=hexagon) as replay:
            replay.wait_for_text("finished: published", 60.0)
        alone.status.wait_for("state", "waiting for the last answers")
        assert NO_SERVER in alone.status.message and alone.results == before
        with hosted_node("predict_server", domain=alone.domain, params={"models": [str(models["gp"])]}):
            alone.wait_for_result(before + 1, 120.0)
        assert_same_as_offline(alone.output, models["gp"], hexagon)

    def test_refused_windows_and_invalid_gaussians_are_listed_and_not_scored(self, alone: Bench, models, hexagon: Path):
        before, stub = alone.results, StubServer(alone.node)
        alone.status.wait_for_server()
        with hosting_replay(alone.domain, recording=hexagon):
            alone.wait_for_result(before + 1)
        alone.node.destroy_service(stub.service)
        log, result = (json.loads((alone.output / f"{name}.json").read_text()) for name in ("windows", "validation"))
        reasons = [entry["reason"] for entry in log["refused"]]
        alone.status.wait_for("refused", str(len(reasons)))
        assert f"predict_push refused {len(reasons)} requests" in alone.status.message
        total = len(validate_recording(load_model(models["gp"]), hexagon)[0])
        assert result["n_test"] == len(log["windows"]) == total - len(reasons) and log["unanswered"] == 0
        assert {reason.split(":")[0] for reason in reasons} == {"response mean", "covariance", "angle"}
        known = {(w["push_id"], w["window"]) for w in log["windows"]}
        assert not known & {(entry["push_id"], entry["window"]) for entry in log["refused"]}

    def test_unanswered_windows_are_counted_and_not_scored(self, alone: Bench, models, hexagon: Path, monkeypatch):
        monkeypatch.setattr(session, "CALLER_PATIENCE", 1.0)  # s
        alone.status.wait_for_message(NO_SERVER)
        with hosting_replay(alone.domain, *PLAYING_ALONE, recording=hexagon) as replay:
            replay.wait_for_text("finished: published", 60.0)
        assert finish(alone.node).success
        total = len(validate_recording(load_model(models["gp"]), hexagon)[0])
        alone.status.wait_for_news()
        assert (alone.status.values["gp windows"], alone.status.values["open requests"]) == ("0", "0")
        assert any(f"never answered for {total} windows" in text for text in alone.log)
        assert json.loads((alone.output / "windows.json").read_text())["unanswered"] == total
        assert json.loads((alone.output / "validation.json").read_text())["n_test"] == 0


# --- models by name, in a namespace ----------------------------------------------------------------------------------

CELL = ("-r", "slider/pose:=/vicon/butter/butter", "-r", "pusher/wrench:=ft/wrench")
OWN_RIG = ("-r", "rig:=nowhere")


@pytest.fixture(scope="class")
def named(
    models: dict[str, Path], hexagon: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[Bench, dict[str, Any]]]:
    """A validator in a namespace, with a rig file, of the server's default model and of one that is loaded only after
    a replay, and what happened until then.
    """
    output, before = tmp_path_factory.mktemp("named"), {}
    rig = output / "hexagon.rig.yaml"
    save_rig(load_rig_for([hexagon]), rig)
    served = {"models": [*map(str, models.values())]}
    with (
        reserved_domain() as domain,
        ros_context(domain, "/cell") as node,
        hosted_node("predict_server", domain=domain, namespace="/cell", params=served),
        hosted(domain, *CELL, *OWN_RIG, namespace="/cell", compare=["hexagon"], output=output, rig=rig) as process,
    ):
        bench = Bench(domain, node, process, output)
        bench.status.wait_for_first()
        with hosting_replay(domain, *CELL, "-r", "__ns:=/cell", recording=hexagon) as replay:
            replay.wait_for_text("finished: published", 60.0)
        before["status"] = bench.status.wait_for_message("hexagon")
        assert bench.status.identity == ("/cell/push_validator: validation", "hex")
        before["answer"] = finish(node)
        before["written"] = (output / "validation.json").exists()
        request = LoadModel.Request(path=str(models["analytical"]), name="hexagon")
        assert call(node.create_client(LoadModel, "load_model"), request).success
        process.wait_for_text(WRITTEN, 60.0)
        before["output"] = Path(shutil.copytree(output, output.with_name("named_first")))
        yield bench, before


class TestOneValidator:
    """Runs of one validator in a namespace with remapped topics."""

    def test_waits_for_a_model_that_the_server_has_not_loaded(self, named, models, hexagon: Path):
        _, before = named
        assert "predict_server has no model 'hexagon'. Its models: gp, analytical." in before["status"]
        assert not before["answer"].success and "hexagon" in before["answer"].message
        assert not before["written"]
        assert_same_as_offline(before["output"], models["analytical"], hexagon, suffix="_hexagon")

    def test_works_in_a_namespace_with_remapped_topics_and_a_rig_file(self, named, models, hexagon: Path):
        """No model is given: the server's default is its first."""
        _, before = named
        assert_same_as_offline(before["output"], models["gp"], hexagon)

    def test_paused_sought_and_looped_replays_are_one_run_that_counts_time_jumps(self, named, models, hexagon: Path):
        windows, _ = validate_recording(load_model(models["gp"]), hexagon)
        begin, middle = (Seek.Request(time=ns_to_stamp(windows[k].start)) for k in (0, len(windows) // 2))
        bench, _ = named
        node, status = bench.node, bench.status

        def figure(key: str) -> int:
            return int(status.values.get(key, "0"))

        pause, resume, set_rate, seek = (
            node.create_client(kind, f"push_replay/{name}")
            for kind, name in ((Pause, "pause"), (Resume, "resume"), (SetRate, "set_rate"), (Seek, "seek"))
        )
        looping = {"rate": 5.0, "recording": hexagon, "play.loop": True}
        with hosting_replay(bench.domain, *CELL, "-r", "__ns:=/cell", **looping):
            acquaint(node, "push_replay")
            assert wait_until(lambda: figure("streams clock_set_back") >= 1), "looped"
            call(pause, Pause.Request())
            status.wait_for_news()
            samples = figure("slider samples")
            # From the middle, at this rate, the replay loops only after 13 s: an earlier jump is the seek.
            assert call(set_rate, SetRate.Request(rate=0.2)).success and call(seek, middle).success
            call(resume, Resume.Request())
            assert wait_until(lambda: figure("slider samples") >= samples + 20)
            before = figure("streams clock_set_back")
            assert call(seek, begin).success
            assert wait_until(lambda: figure("streams clock_set_back") > before)
        assert finish(node).success
        offline = {window.push_id for window in windows}
        assert len(offline & {entry["push_id"] for entry in windows_of(bench.output)}) >= len(offline) - 1

    @pytest.mark.long
    def test_another_rig_ends_the_run_and_a_model_of_another_slider_gives_a_warning(
        self, served: int, models, hexagon: Path, tmp_path: Path
    ):
        circle = beginning(CIRCLE, 5.8, tmp_path / "circle")
        with ros_context(served) as node, validator(served, model=models["gp"], output=tmp_path / "out") as process:
            bench = Bench(served, node, process, tmp_path / "out")
            bench.status.wait_for_server()  # a change of the rig waits 5 s for answers
            with replaying(served, *PLAYING_ALONE, recording=hexagon) as replay:
                replay.wait_for_text("finished: published", 60.0)
            with replaying(served, *PLAYING_ALONE, recording=circle) as replay:
                bench.wait_for_result(1)
                assert_same_as_offline(bench.output, models["gp"], hexagon)
                replay.wait_for_text("finished: published", 60.0)
            message = bench.status.wait_for_message("was trained with the outline")
            assert "'hex'" in message and "'ellip1'" in message and bench.status.all[-1][0] == DiagnosticStatus.WARN
            assert finish(node).success
            assert_same_as_offline(bench.output, models["gp"], circle)


# --- the end of a run ------------------------------------------------------------------------------------------------


def test_finish_writes_everything_later_samples_begin_a_new_run_and_the_end_interrupts_it(
    served: int, models, hexagon: Path, tmp_path: Path
):
    """replay_status is remapped away, as if another program played."""
    params = {"model": models["gp"], "output": tmp_path, "report": True}
    with ros_context(served) as node, validator(served, *PLAYING_ALONE, **params) as process:
        received, stray = Listener(node), node.create_publisher(PoseStamped, "slider/pose", 100)
        status = received.status
        answer = finish(node)
        assert not answer.success and "rig" in answer.message
        status.wait_for_server()  # a caller of ~/finish waits 5 s for answers
        with hosting_replay(served, recording=hexagon) as replay:
            replay.wait_for_text("finished: published", 60.0)
        answer = finish(node, timeout=60.0)
        assert answer.success and answer.message == str(tmp_path)
        assert_same_as_offline(tmp_path, models["gp"], hexagon)
        assert (tmp_path / "report.html").stat().st_size > 10_000
        first = (tmp_path / "validation.json").read_text()
        assert finish(node).success, "a second call changes nothing"

        stray.publish(pose())
        status.wait_for("state", "validating")
        assert finish(node).success
        assert (tmp_path / "validation.json").read_text() == first, "a run without a push replaces no result"

        (tmp_path / "report.html").unlink()
        received.residuals.clear()
        with hosting_replay(served, recording=hexagon, **{"play.start_paused": True}):
            play_some(node, TWO_PUSHES)
            assert wait_until(lambda: len(received.residuals) >= 8, 60.0)
            assert wait_until(lambda: int(status.values.get("gp windows", "0")) >= 8), (
                "scores are published during the run"
            )
            assert process.stop(signal.SIGTERM, timeout=20.0) == 0  # not the 30 s of last_answers
    windows, _ = validate_recording(load_model(models["gp"]), hexagon)
    found = [(w["push_id"], w["window"]) for w in windows_of(tmp_path)]
    assert 8 <= len(found) < len(windows)
    assert found == [(w.push_id, w.index) for w in windows[: len(found)]]
    assert json.loads((tmp_path / "validation.json").read_text())["n_test"] == len(found)
    assert len(list(open_bag(tmp_path / "residuals").messages())) == len(found)
    assert not (tmp_path / "report.html").exists()


# --- messages that no sensor should send -----------------------------------------------------------------------------


def pose(frame: str = "world", x: float = 0.0, w: float = 1.0) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id, message.header.stamp.sec = frame, 1_700_000_000
    message.pose.position.x, message.pose.orientation.w = x, w
    return message


def subscribed(node: Node, topic: str) -> list[ReliabilityPolicy]:
    return [info.qos_profile.reliability for info in node.get_subscriptions_info_by_topic(topic)]


def test_unusable_messages_are_counted_by_kind(domain: int, models):
    overrides = ("-p", "qos_overrides./slider/pose.subscription.reliability:=best_effort")
    with ros_context(domain) as node, hosted(domain, *overrides, model=models["gp"]) as process:
        status = Status(node)
        slider, pusher = (node.create_publisher(PoseStamped, f"{name}/pose", 100) for name in ("slider", "pusher"))
        wrench = node.create_publisher(WrenchStamped, "pusher/wrench", 100)
        node.create_publisher(WrenchStamped, "pusher/wrench", qos_profile_sensor_data)  # the other one is reliable
        rig = node.create_publisher(PushRig, "rig", LATCHED)  # created last: who has received it knows the others too
        for publisher in (slider, pusher, wrench):
            assert wait_until(lambda publisher=publisher: publisher.get_subscription_count() > 0)
        assert subscribed(node, "/slider/pose") == [ReliabilityPolicy.BEST_EFFORT]
        assert subscribed(node, "/pusher/pose") == [ReliabilityPolicy.RELIABLE]
        assert wait_until(lambda: subscribed(node, "/pusher/wrench") == [ReliabilityPolicy.BEST_EFFORT])

        rig.publish(PushRig(shape="rect1"))
        assert "outline" in status.wait_for_message("topic rig: push_rig")
        rig.publish(rig_to_message(rig_from_record(RIG, "here")))
        for message in (pose(), pose(x=math.nan), pose("map"), pose("map"), pose(w=0.0)):
            slider.publish(message)
        for message in (pose(w=0.0), pose(x=-math.inf)):
            pusher.publish(message)
        status.wait_for("slider rejected", "4")
        status.wait_for("pusher rejected", "1")
        values = status.values
        assert (values["slider samples"], values["pusher samples"]) == ("5", "2")
        assert values["slider rejected not finite"] == "1"
        assert values["slider rejected frame_id"] == "2"
        assert values["slider rejected no orientation"] == "1"
        assert values["pusher rejected not finite"] == "1"
        assert "/slider/pose: 4 of 5 samples were rejected" in status.message
        assert finish(node).success
        assert process.stop() == 0, process.text()


def test_a_validator_without_samples_refuses_a_wrong_type_and_states_at_its_end_what_was_missing(domain: int, models):
    with ros_context(domain) as node, hosted(domain, model=models["gp"]) as process:
        status, wrong = Status(node), node.create_publisher(JointState, "slider/pose", 10)
        status.wait_for_message("is of type 'sensor_msgs/msg/JointState', which has no pose")
        assert status.all[-1][0] == DiagnosticStatus.ERROR
        process.wait_for_text("which has no pose", 30.0)
        node.destroy_publisher(wrong)
        status.wait_for_message("/slider/pose: No publisher.")
        assert process.stop() == 0, process.text()
        lines = [line for line in process.text().splitlines() if "JointState" in line and "slider:" in line]
        assert len(lines) == 1 and "[ERROR]" in lines[0], "logged once"
        ending = process.text().rpartition("Nothing was validated. ")[2]
    assert "No rig yet" in ending and "/slider/pose" in ending and "/pusher/pose" in ending


def test_the_log_names_a_report_that_the_end_interrupts():
    logged: list[str] = []
    writer = ResultWriter("", SimpleNamespace(warning=logged.append))
    stopped: list[bool] = []
    writer.report = SimpleNamespace(alive=True, stop=lambda: stopped.append(True))
    writer.close()
    assert stopped == [True] and "The report was interrupted" in logged[0]


def test_no_markers_are_made_while_nobody_subscribes(monkeypatch: pytest.MonkeyPatch):
    """Calls the class itself: without a subscriber nothing can be received."""
    made: list[Any] = []
    monkeypatch.setattr(results, "window_markers", lambda *of_what: made.append(of_what))
    for subscribers in (0, 1):
        topic = SimpleNamespace(get_subscription_count=lambda count=subscribers: count, publish=lambda message: None)
        node = SimpleNamespace(create_publisher=lambda *of_what, topic=topic: topic, get_logger=lambda: None)
        results.ResultPublishers(node, lambda: "world").publish("rig", 0, "window", "prediction", "residual")
        assert len(made) == subscribers


# --- starting --------------------------------------------------------------------------------------------------------


def test_a_bad_parameter_ends_the_start_with_one_line(models, tmp_path: Path, monkeypatch, capfd):
    blocked, twin = tmp_path / "file", tmp_path / "twin.pushmodel"
    blocked.write_text("no folder")
    twin.write_bytes(models["gp"].read_bytes())
    cases: list[tuple[dict[str, Any], tuple[str, ...]]] = [
        ({"output": blocked / "in"}, ("output", str(blocked), "folder")),
        ({"model": blocked}, (str(blocked), "not a model file")),
        ({"rig": tmp_path / "absent.yaml"}, ("absent.yaml", "cannot be read")),
        ({"model": models["gp"], "compare": [str(twin)]}, ("compare", "gp", "different")),
    ]
    for k, (params, words) in enumerate(cases):
        named = ("-r", f"__node:=validator_{k}")
        line = refused_start(push_validator.main, monkeypatch, capfd, *named, **params)
        assert line.startswith("push_validator: ") and all(word in line for word in words), line

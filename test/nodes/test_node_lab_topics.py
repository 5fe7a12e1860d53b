# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A laboratory's topics, as Vicon and a UR driver publish them, through real nodes: the windows of the recording."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")
from hosted_nodes import hosted_node
from lab_bags import Lab, pose_rows, robot_in_tf, short_recording
from ros_harness import free_domain, ros_context
from standard_interfaces import provide_interfaces
from turning_sensor import MOUNT, add_tip, add_wrench, measured_at
from validator_bench import WRITTEN, Status, assert_same_as_offline, hosting_replay, hosting_validator

from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import train_model
from push_predictor.recordings.fields.pose_rows import composed, inverted, normalised, poses_at
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.topics import STREAMS, Topics, save_topics
from push_predictor.recordings.windows.finder import find_windows

pytestmark = pytest.mark.slow

SECONDS = 6.0  # of the recording: three pushes
FORCE = "/force_torque_sensor_broadcaster/wrench"
IN_TF = Topics("/tracker/block", "/tf:tip", FORCE, world="world", wrench_frame="ft")
BASE = normalised(np.array([[-0.6, 0.1, 0.05, 0.1, -0.05, 0.5, 0.8]]))  # of the robot in the world


@dataclass(frozen=True)
class Rig:
    """A recording in a laboratory's types, its topics, and a model of its slider."""

    bag: Path
    topics: Topics
    model: Path


def recorded(folder: Path, lab: Lab, topics: Topics) -> Rig:
    """Some seconds of pushes, as an MCAP bag with its topics next to it."""
    bag = lab.mcap(folder / "lab", short_recording(SECONDS).rig)
    save_topics(bag, topics)
    model = folder / "square.pushmodel"
    save_model(train_model(load_data([bag]), load_rig_for([bag]), "analytical", name="square"), model)
    return Rig(bag, topics, model)


def robot_with_force() -> Lab:
    """A block seen from the robot's base, a tip below moving frames of tf, and a force sensor askew on the tip."""
    recording = short_recording(SECONDS)
    assert recording.wrench is not None
    lab, stamp = robot_in_tf(recording), recording.wrench.stamp
    mounted = measured_at(recording.wrench, poses_at(stamp, recording.pusher.stamp, pose_rows(recording.pusher)))
    lab.transform("/tf_static", "tip", "ft", stamp[:1], MOUNT)
    lab.transform("/tf_static", "world", "base_link", stamp[:1], BASE)
    seen = composed(inverted(np.repeat(BASE, len(recording.slider), axis=0)), pose_rows(recording.slider))
    lab.frame = "base_link"
    add_tip(lab, IN_TF.slider, recording.slider.stamp, seen)
    add_wrench(lab, IN_TF.wrench, stamp, mounted, "ft")
    return lab


def parameters(rig: Rig, output: Path) -> dict[str, object]:
    topics = {f"{name}_topic": getattr(rig.topics, name) for name in STREAMS}
    topics |= {"wrench_frame": rig.topics.wrench_frame, "world_frame": rig.topics.world}
    return {**topics, "model": rig.model, "output": output, "report": False, "diagnostics_period": 0.2}


@pytest.fixture
def tf_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """tf2_msgs for the nodes: installed, or in the folder PUSH_PREDICTOR_TF2_MSGS (scripts/install_tf2_msgs.sh)."""
    provide_interfaces("tf2_msgs", monkeypatch)


def test_a_bag_its_validation_and_its_copy_by_the_recorder_have_equal_windows(
    tmp_path: Path, tf_installed: None
) -> None:
    """A slider in the base's frame, which tf turns into the world, a tip that is a frame, a wrench along another."""
    rig, domain, output = recorded(tmp_path, robot_with_force(), IN_TF), free_domain(), tmp_path / "out"
    with (
        ros_context(domain) as node,
        hosted_node("predict_server", domain=domain, params={"models": [str(rig.model)]}),
        hosting_validator(domain=domain, params=parameters(rig, output)) as process,
    ):
        status = Status(node)
        status.wait_for_first()
        status.wait_for_server()
        with hosting_replay(domain, recording=rig.bag, rate=3.0):
            process.wait_for_text(WRITTEN, 60.0)
        turned = "Its axes are turned from 'ft' by tf."
        assert any(turned in values.get("wrench topic", "") for *_, values in status.all), process.text()
        assert f"pusher: {IN_TF.pusher}, tf2_msgs/msg/TFMessage, reliable, frame_id 'world'" in process.text()
        assert process.stop() == 0, process.text()
    assert_same_as_offline(output, rig.model, rig.bag)
    assert_windows_of_the_poses(output)
    record_again(rig, tmp_path / "copy")
    bag, validated, copy = (load_data([path]) for path in (rig.bag, output / "pushes.csv", tmp_path / "copy"))
    for other in (validated, copy):
        assert other.push_id.tolist() == bag.push_id.tolist()
        np.testing.assert_allclose(other.inputs, bag.inputs, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(other.outcomes, bag.outcomes, rtol=0.0, atol=1e-9)
        for name in ("normal_force", "tangential_force"):
            np.testing.assert_allclose(other.covariates[name], bag.covariates[name], rtol=0.0, atol=1e-9)


def record_again(rig: Rig, copy: Path) -> None:
    """Record a replay of the bag. One node listens: a replay waits for one."""
    topics = {f"{name}_topic": getattr(rig.topics, name) for name in STREAMS}
    params = {**topics, "wrench_frame": rig.topics.wrench_frame, "world_frame": rig.topics.world, "bag": copy}
    domain = free_domain()
    with (
        ros_context(domain) as node,
        hosted_node("push_recorder", domain=domain, params=params) as process,
    ):
        status, samples = Status(node, "push_recorder"), len(short_recording(SECONDS).slider)
        status.wait_for_first()
        with hosting_replay(domain, recording=rig.bag, rate=4.0) as replay:
            replay.wait_for_text("finished: published", 60.0)
            status.wait_for("slider samples", str(samples))
        assert process.stop() == 0, process.text()


def assert_windows_of_the_poses(output: Path) -> None:
    """Assert the windows that the recording as PoseStamped has."""
    recording = short_recording(SECONDS)
    assert recording.rig is not None
    online = json.loads((output / "windows.json").read_text())["windows"]
    expected = find_windows(recording, recording.rig)
    assert len(expected) > 10
    assert [(w["start"], w["end"]) for w in online] == [(w.start, w.end) for w in expected]
    for found, window in zip(online, expected, strict=True):
        given = [window.velocity, window.contact, window.angle, *window.displacement]
        assert [found["velocity"], found["contact"], found["angle"], *found["observed"]] == pytest.approx(
            given, abs=1e-9
        )

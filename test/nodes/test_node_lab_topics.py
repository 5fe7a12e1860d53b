# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A laboratory's topics, as Vicon and a UR driver publish them, through real nodes: the windows of the recording."""

from __future__ import annotations

import importlib.util
import json
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

pytest.importorskip("rosbags")
from diagnostic_msgs.msg import DiagnosticStatus
from lab_bags import Lab, pose_rows, robot_in_tf, short_recording
from ros_harness import free_domain, node_process, ros_context
from sensor_msgs.msg import JointState
from turning_sensor import MOUNT, add_wrench, measured_at
from validator_bench import WRITTEN, Status, assert_same_as_offline, replaying

from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import train_model
from push_predictor.recordings.fields.pose_rows import poses_at
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.topics import Topics, save_topics
from push_predictor.recordings.windows.finder import find_windows

pytestmark = pytest.mark.slow

VICON, UR, FORCE, TIP = "/vicon/block/block", "/ur5/tool0_pose", "/force_torque_sensor_broadcaster/wrench", "/tf:tip"
TRANSFORM = "geometry_msgs/msg/TransformStamped"


@dataclass(frozen=True)
class Rig:
    """A recording in a laboratory's types, its topics next to it, a model of its slider, and a QoS file."""

    bag: Path
    topics: Topics
    model: Path
    overrides: Path


def recorded(folder: Path, tip: str) -> Rig:
    """Eight seconds of pushes: block as TransformStamped and tip as PoseStamped, or both and a sensor in tf."""
    recording = short_recording()
    assert recording.wrench is not None and recording.rig is not None
    lab = robot_in_tf(recording) if tip == TIP else Lab()
    if tip == UR:
        lab.pose(VICON, TRANSFORM, recording.slider, "transform")
        lab.pose(UR, "geometry_msgs/msg/PoseStamped", recording.pusher, "pose")
        lab.wrench(FORCE, recording.wrench, "geometry_msgs/msg/WrenchStamped", "wrench")
        topics = Topics(VICON, tip, FORCE)
    else:
        stamp, poses = recording.wrench.stamp, pose_rows(recording.pusher)
        mounted = measured_at(recording.wrench, poses_at(stamp, recording.pusher.stamp, poses))
        lab.transform("/tf_static", "tip", "ft", stamp[:1], MOUNT)
        add_wrench(lab, FORCE, stamp, mounted, "ft")
        topics = Topics("/tf:block", tip, FORCE, wrench_frame="ft")
    bag = lab.mcap(folder / "lab", recording.rig)
    save_topics(bag, topics)
    (folder / "qos.yaml").write_text("".join(f"{topic}: {{reliability: best_effort}}\n" for topic in (VICON, UR)))
    model = folder / "square.pushmodel"
    save_model(train_model(load_data([bag]), load_rig_for([bag]), "analytical", name="square"), model)
    return Rig(bag, topics, model, folder / "qos.yaml")


def parameters(rig: Rig, output: Path) -> dict[str, object]:
    topics = {f"{name}_topic": getattr(rig.topics, name) for name in ("slider", "pusher", "wrench")}
    topics["wrench_frame"] = rig.topics.wrench_frame
    return {**topics, "model": rig.model, "output": output, "report": False, "diagnostics_period": 0.2}


@pytest.fixture
def tf_installed(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """tf2_msgs for the nodes: installed, or in the folder PUSH_PREDICTOR_TF2_MSGS (scripts/install_tf2_msgs.sh)."""
    prefix = os.environ.get("PUSH_PREDICTOR_TF2_MSGS")
    if importlib.util.find_spec("tf2_msgs") is None and not prefix:
        pytest.skip("tf2_msgs is not installed: scripts/install_tf2_msgs.sh FOLDER, PUSH_PREDICTOR_TF2_MSGS=FOLDER")
    if prefix:
        site = Path(prefix, "lib", f"python{sys.version_info.major}.{sys.version_info.minor}", "site-packages")
        for name, folder in (("PYTHONPATH", site), ("LD_LIBRARY_PATH", Path(prefix, "lib"))):
            monkeypatch.setenv(name, os.pathsep.join(filter(None, [str(folder), os.environ.get(name)])))
    yield


def test_best_effort_transforms_give_the_windows_of_the_recording_after_a_wrong_type(tmp_path: Path) -> None:
    rig, domain, output = recorded(tmp_path, UR), free_domain(), tmp_path / "out"
    with (
        ros_context(domain) as node,
        node_process("predict_server", domain=domain, params={"models": [str(rig.model)]}),
        node_process("push_validator", domain=domain, params=parameters(rig, output)) as process,
    ):
        status = Status(node)
        status.wait_for_first()
        wrong = node.create_publisher(JointState, VICON, 10)
        message = status.wait_for_message("is of type 'sensor_msgs/msg/JointState', which has no pose")
        assert f"slider_topic '{VICON}'" in message and status.all[-1][0] == DiagnosticStatus.ERROR
        node.destroy_publisher(wrong)
        status.wait_for_server()
        with replaying(domain, recording=rig.bag, rate=2.0, **{"play.qos_profile_overrides_path": rig.overrides}):
            process.wait_for_text(WRITTEN, 60.0)
        assert f"slider: {VICON}, {TRANSFORM}, best effort, frame_id 'world', 1" in process.text(), process.text()
        lines = [line for line in process.text().splitlines() if "JointState" in line]
        assert len(lines) == 1 and "[ERROR]" in lines[0], "logged once"
        assert f"pusher: {UR}, geometry_msgs/msg/PoseStamped, best effort" in process.text()
        assert f"wrench: {FORCE}, geometry_msgs/msg/WrenchStamped, reliable" in process.text()
        assert process.stop() == 0, process.text()
    assert_same_as_offline(output, rig.model, rig.bag)
    assert_windows_of_the_poses(output)


def test_frames_of_tf_give_the_windows_of_the_recording(tmp_path: Path, tf_installed: None) -> None:
    rig, domain, output = recorded(tmp_path, TIP), free_domain(), tmp_path / "out"
    with (
        ros_context(domain) as node,
        node_process("predict_server", domain=domain, params={"models": [str(rig.model)]}),
        node_process("push_validator", domain=domain, params=parameters(rig, output)) as process,
    ):
        status = Status(node)
        status.wait_for_first()
        status.wait_for_server()
        with replaying(domain, recording=rig.bag, rate=2.0, **{"play.qos_profile_overrides_path": rig.overrides}):
            process.wait_for_text(WRITTEN, 60.0)
        assert "Its axes are turned from 'ft' by tf." in process.text()
        assert f"pusher: {TIP}, tf2_msgs/msg/TFMessage, reliable, frame_id 'world'" in process.text()
        assert process.stop() == 0, process.text()
    assert_same_as_offline(output, rig.model, rig.bag)
    assert_windows_of_the_poses(output)


def assert_windows_of_the_poses(output: Path) -> None:
    """Assert the windows that the recording as PoseStamped has."""
    recording = short_recording()
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

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/pictures/rviz.png: one window's markers in RViz 1.14 of ROS 1, with config/push_predictor.rviz translated.

    apt-get install rviz xvfb imagemagick python3-rospy python3-roslaunch python3-rosmaster python3-visualization-msgs
    python -m docs.pictures.draw_rviz

RViz2 is in no registry that serves Python wheels or Debian packages; RViz 1.14 is the Debian package from which RViz2
was ported. The messages are those that push_validator and push_replay publish in ROS 2. docs/pictures/publish_ros1.py
publishes the same values in ROS 1.
"""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import rclpy
import yaml
from geometry_msgs.msg import PoseStamped

from examples.draw_markers import HELD_OUT, KINDS, Listener, along, record_replay, size_of
from push_predictor.recordings.load import load_rig_for
from push_predictor.resources import DEFAULT_MODEL, share_path

ROOT = Path(__file__).resolve().parents[2]
PICTURE, CONFIG = ROOT / "docs" / "pictures" / "rviz.png", ROOT / "config" / "push_predictor.rviz"
PUBLISHER = Path(__file__).with_name("publish_ros1.py")
KIND = "off centre"  # of KINDS in examples/draw_markers.py
POSES = ("slider/pose", "pusher/pose")
DISPLAY, STARTUP, DRAWING = ":87", 4.0, 15.0  # X display; s
IN_RVIZ_1 = {"rviz_default_plugins/Wrench": "rviz/WrenchStamped", "rviz_default_plugins": "rviz", "rviz_common": "rviz"}
TOPIC_OF = {"rviz/MarkerArray": "Marker Topic"}  # its name in RViz 1; Topic for the others


class PoseListener(Listener):
    """Also the poses, by topic and stamp."""

    def __init__(self, subscriber_node: rclpy.node.Node) -> None:
        super().__init__(subscriber_node)
        self.poses: dict[str, dict[tuple[int, int], PoseStamped]] = {topic: {} for topic in POSES}
        for topic in POSES:
            subscriber_node.create_subscription(PoseStamped, topic, self._on_pose(topic), 1000)

    def _on_pose(self, topic: str) -> Any:
        def take(message: PoseStamped) -> None:
            self.poses[topic][message.header.stamp.sec, message.header.stamp.nanosec] = message

        return take


def main() -> int:
    """Record a replay, choose a window, show it in RViz, and save the screen."""
    received = record_replay(share_path(*DEFAULT_MODEL), PoseListener)
    messages = [[topic, type_name, as_fields(message)] for topic, type_name, message in window_messages(received)]
    with tempfile.TemporaryDirectory(prefix="draw_rviz_") as folder:
        content, config = Path(folder) / "messages.json", Path(folder) / "ros1.rviz"
        content.write_text(json.dumps(messages))
        config.write_text(yaml.safe_dump(translated(yaml.safe_load(CONFIG.read_text()))))
        show(content, config, Path(folder))
    print(PICTURE)
    return 0


def translated(config: Mapping[str, Any]) -> dict[str, Any]:
    """The configuration of RViz2 in RViz 1's format: names of classes, topics as text, no QoS, no transformation."""
    plain = _renamed(config)
    manager = plain["Visualization Manager"]
    manager.pop("Transformation", None)
    for display in manager["Displays"]:
        if topic := display.pop("Topic", None):
            display[TOPIC_OF.get(display["Class"], "Topic")] = "/" + topic["Value"]
            display["Queue Size"] = topic["Depth"]
    return plain


def as_fields(message: Any) -> Any:
    """A message of ROS 2 as nested dictionaries with the field names of ROS 1 for times."""
    if hasattr(message, "get_fields_and_field_types"):
        names = message.get_fields_and_field_types()
        fields = {name: as_fields(getattr(message, name)) for name in names}
        if fields.keys() == {"sec", "nanosec"}:
            return {"secs": fields["sec"], "nsecs": fields["nanosec"]}
        return fields
    if isinstance(message, (str, bytes, bool, int, float)):
        return message
    return [as_fields(item) for item in message]


def window_messages(received: PoseListener) -> Iterator[tuple[str, str, Any]]:
    """Topic, type and message of what is shown: the window of the kind with the median error, poses at its end."""
    outline = load_rig_for([HELD_OUT]).outline
    is_of_kind = dict(KINDS)[KIND]
    of_kind = [
        (size_of(window), stamp)
        for stamp, window in received.residuals.items()
        if stamp in received.markers and is_of_kind(window, along(outline, window))
    ]
    _, end = sorted(of_kind)[len(of_kind) // 2]
    yield "push_markers", "visualization_msgs/MarkerArray", received.markers[end]
    for topic, poses in received.poses.items():
        yield topic, "geometry_msgs/PoseStamped", poses[max(stamp for stamp in poses if stamp <= end)]


def show(messages: Path, config: Path, folder: Path) -> None:
    """Run a ROS 1 master, the publisher and RViz on a virtual screen, and save the screen to PICTURE."""
    size = yaml.safe_load(config.read_text())["Window Geometry"]
    window = f"{size['Width']}x{size['Height']}+{size['X']}+{size['Y']}"
    screen = f"{size['Width'] + size['X']}x{size['Height'] + size['Y']}x24"
    port = _free_port()
    with ExitStack() as running:

        def start(*command: str) -> None:
            running.enter_context(_process(command, folder, port))
            time.sleep(STARTUP)

        start("Xvfb", DISPLAY, "-screen", "0", screen)
        start("roscore", "-p", str(port))
        start("/usr/bin/python3", str(PUBLISHER), str(messages))
        start("rviz", "--display-config", str(config))
        time.sleep(DRAWING)
        grab = ["import", "-display", DISPLAY, "-window", "root", "-crop", window, "+repage", str(PICTURE)]
        subprocess.run(grab, check=True, env=_environment(folder, port))


@contextmanager
def _process(command: tuple[str, ...], folder: Path, port: int) -> Iterator[None]:
    log = (folder / f"{Path(command[0]).name}.log").open("w")
    process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env=_environment(folder, port))
    try:
        yield
    finally:
        process.terminate()
        process.wait(20.0)


def _environment(folder: Path, port: int) -> dict[str, str]:
    """Nothing of the ROS 2 wheels: their libraries are not those of ROS 1."""
    return {
        "PATH": "/usr/bin:/bin",
        "HOME": str(folder),
        "ROS_HOME": str(folder),
        "DISPLAY": DISPLAY,
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "ROS_MASTER_URI": f"http://localhost:{port}",
        "ROS_HOSTNAME": "localhost",
        "ROS_PACKAGE_PATH": "/usr/share",
        "XDG_RUNTIME_DIR": str(folder),
    }


def _renamed(value: Any) -> Any:
    """All texts with the plugin names of RViz 1."""
    if isinstance(value, Mapping):
        return {name: _renamed(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_renamed(item) for item in value]
    if isinstance(value, str):
        for name, other in IN_RVIZ_1.items():
            value = value.replace(name, other)
    return value


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        return int(probe.getsockname()[1])


if __name__ == "__main__":
    sys.exit(main())

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""config/push_predictor.rviz and config/foxglove_layout.json: what they ask for is what the running nodes publish.

RViz2 and Foxglove cannot be run here. docs/pictures/draw_rviz.py shows the configuration, translated, in RViz 1.14.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import numpy as np
import pytest
import yaml
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSCompatibility,
    QoSProfile,
    ReliabilityPolicy,
    qos_check_compatible,
)
from ros_harness import REPOSITORY, free_domain, ros_context, wait_until
from validator_bench import hosting_replay, hosting_validator

from msg_adapters.markers import window_markers
from push_predictor.models.prediction import Prediction
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.windows.push_window import PushWindow

RECORDING = REPOSITORY / "bags" / "hexagon_delrin"
RVIZ = yaml.safe_load((REPOSITORY / "config" / "push_predictor.rviz").read_text())
FOXGLOVE = json.loads((REPOSITORY / "config" / "foxglove_layout.json").read_text())
SHOWN_TYPE = {
    "rviz_default_plugins/MarkerArray": "visualization_msgs/msg/MarkerArray",
    "rviz_default_plugins/Pose": "geometry_msgs/msg/PoseStamped",
    "rviz_default_plugins/Wrench": "geometry_msgs/msg/WrenchStamped",
}
DRAWN_IN_3D = set(SHOWN_TYPE.values()) - {"geometry_msgs/msg/WrenchStamped"}
PANELS = {"3D", "Plot", "DiagnosticSummary", "RawMessages"}


@pytest.fixture(scope="module")
def published() -> dict[str, list[Any]]:
    """What the replay and the validator publish: endpoint infos by topic."""
    domain = free_domain()
    with (
        ros_context(domain) as node,
        hosting_replay(domain, recording=RECORDING, **{"play.start_paused": True}),
        hosting_validator(domain=domain),
    ):
        of_replay = {"/slider/pose", "/pusher/pose", "/pusher/wrench", "/replay_status"}
        of_validator = {"/push_residual", "/push_markers", "/push_alarm"}
        wanted = of_replay | of_validator | {"/diagnostics"}
        assert wait_until(lambda: all(node.count_publishers(name) for name in wanted), 60.0)
        return {name: node.get_publishers_info_by_topic(name) for name, _ in node.get_topic_names_and_types()}


def displays() -> list[dict[str, Any]]:
    return [display for display in RVIZ["Visualization Manager"]["Displays"] if "Topic" in display]


def shown_namespaces() -> set[str]:
    rig = read_recording(RECORDING).rig
    assert rig is not None
    still = np.zeros(3)
    window = PushWindow("p", 0, 0, 1, 0.02, 0.1, 0.0, 0.2, still, still, still, 0.0, {})
    prediction = Prediction(still[None], np.eye(3)[None], np.eye(3)[None], np.array([True]))
    return {marker.ns for marker in window_markers(rig, window, prediction, "world").markers}


# --- RViz ------------------------------------------------------------------------------------------------------------


def test_every_display_of_rviz_finds_its_topic_with_its_type_and_a_compatible_qos(published):
    assert {display["Topic"]["Value"] for display in displays()} >= {"push_markers", "slider/pose", "pusher/pose"}
    for display in displays():
        topic = display["Topic"]
        assert not topic["Value"].startswith("/")  # follows a namespace
        asked = QoSProfile(
            depth=topic["Depth"],
            history=HistoryPolicy[topic["History Policy"].upper().replace(" ", "_")],
            reliability=ReliabilityPolicy[topic["Reliability Policy"].upper().replace(" ", "_")],
            durability=DurabilityPolicy[topic["Durability Policy"].upper().replace(" ", "_")],
        )
        offered = published["/" + topic["Value"]]
        assert {info.topic_type for info in offered} == {SHOWN_TYPE[display["Class"]]}
        for info in offered:
            compatibility, reason = qos_check_compatible(info.qos_profile, asked)
            assert compatibility != QoSCompatibility.ERROR, reason


def test_rviz_looks_from_above_at_the_frame_of_the_markers():
    manager = RVIZ["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == "world"
    view = manager["Views"]["Current"]
    assert (view["Class"], view["Angle"]) == ("rviz_default_plugins/TopDownOrtho", 0)  # x to the right, y up
    pixels = min(RVIZ["Window Geometry"][side] for side in ("Width", "Height"))
    assert 0.25 < pixels / view["Scale"] < 0.6  # m: room for a slider and what is around it


def test_rviz_shows_each_namespace_of_the_markers_and_no_other():
    (markers,) = (display for display in displays() if display["Class"].endswith("/MarkerArray"))
    assert markers["Namespaces"] == dict.fromkeys(shown_namespaces(), True)


def test_the_document_explains_each_marker():
    section = (
        (REPOSITORY / "docs" / "how_to" / "visualisation.md")
        .read_text()
        .split("\n## The markers\n")[1]
        .split("\n## ")[0]
    )
    rows = [line.split("`")[1] for line in section.splitlines() if line.startswith("| `")]
    assert sorted(rows) == sorted(shown_namespaces())


# --- Foxglove --------------------------------------------------------------------------------------------------------


def leaves(node: Any) -> Iterator[str]:
    if isinstance(node, str):
        yield node
        return
    assert node.keys() == {"first", "second", "direction", "splitPercentage"}
    assert node["direction"] in ("row", "column") and 0 < node["splitPercentage"] < 100
    yield from leaves(node["first"])
    yield from leaves(node["second"])


def message_paths() -> list[str]:
    configs = FOXGLOVE["configById"].values()
    plotted = [path["value"] for config in configs for path in config.get("paths", ())]
    raw = [config["topicPath"] for config in configs if "topicPath" in config]
    return [value for value in (*plotted, *raw) if value.startswith("/")]


def follow(type_name: str, fields: list[str]) -> str:
    """The type at the end of a message path. Raises KeyError where a message has no such field."""
    for field in fields:
        name, _, index = field.partition("[")
        package, message = type_name.split("/msg/")
        declared = getattr(import_module(f"{package}.msg"), message).get_fields_and_field_types()[name]
        assert bool(index) == ("[" in declared or declared.startswith("sequence")), f"{type_name}.{name}"
        type_name = declared.removeprefix("sequence<").removesuffix(">").partition("[")[0]
        type_name = type_name.replace("/", "/msg/") if "/msg/" not in type_name else type_name
    return type_name


def test_every_panel_that_is_configured_is_placed_once():
    placed = list(leaves(FOXGLOVE["layout"]))
    assert sorted(placed) == sorted(FOXGLOVE["configById"])
    assert {panel.partition("!")[0] for panel in placed} == PANELS
    assert all(panel.partition("!")[2].isalnum() for panel in placed)
    assert FOXGLOVE.keys() == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}


def test_every_message_path_leads_to_a_field_that_is_published(published):
    assert len(message_paths()) >= 8
    for path in message_paths():
        topic, *fields = path.partition("{")[0].split(".") + path.partition("}")[2].split(".")[1:]
        (type_name,) = {info.topic_type for info in published[topic]}
        end = follow(type_name, fields)
        assert not fields or end in ("double", "float", "string", "uint32"), path


def test_the_scene_shows_topics_that_it_can_draw_in_the_frame_of_the_markers(published):
    (scene,) = (config for panel, config in FOXGLOVE["configById"].items() if panel.startswith("3D!"))
    assert scene["followTf"] == "world" and not scene["cameraState"]["perspective"]
    assert scene["topics"].keys() == {"/push_markers", "/slider/pose", "/pusher/pose"}
    for topic, settings in scene["topics"].items():
        assert settings["visible"] is True
        assert {info.topic_type for info in published[topic]} <= DRAWN_IN_3D
    for name, layer in scene["layers"].items():
        assert layer["instanceId"] == name and layer["frameId"] == "world"


def test_the_evidence_is_plotted_under_the_name_that_the_diagnostics_give_it():
    quoted = [path.split('"')[1] for path in message_paths() if '"' in path]
    source = (REPOSITORY / "push_predictor" / "nodes" / "validator" / "status.py").read_text()
    assert quoted == ["alarm log10 evidence"]
    assert all(f'"{name}"' in source for name in quoted)
    summaries = [config for panel, config in FOXGLOVE["configById"].items() if panel.startswith("Diagnostic")]
    assert [config["topicToRender"] for config in summaries] == ["/diagnostics"]

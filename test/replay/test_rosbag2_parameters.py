# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of rosbag2's player: each is honoured, refused by name, or changes nothing."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
import yaml
from rclpy.context import Context
from rclpy.node import Node
from ros_harness import free_domain

from push_predictor.errors import RequestError
from push_predictor.nodes.replay.parameters import PARAMETERS, read_options
from push_predictor.replay.options import replay_options
from push_predictor.replay.rosbag2_parameters import check_given

KNOWN = {param.name for param in PARAMETERS}
# Every name of rosbag2's composable player, with its default there.
DEFAULTS: dict[str, Any] = {
    "play.read_ahead_queue_size": 1000,
    "play.node_prefix": "",
    "play.rate": 1.0,
    "play.topics_to_filter": [],
    "play.services_to_filter": [],
    "play.actions_to_filter": [],
    "play.regex_to_filter": "",
    "play.exclude_regex_to_filter": "",
    "play.exclude_topics_to_filter": [],
    "play.exclude_services_to_filter": [],
    "play.exclude_actions_to_filter": [],
    "play.qos_profile_overrides_path": "",
    "play.loop": False,
    "play.topic_remapping_options": [],
    "play.clock_publish_frequency": 0.0,
    "play.clock_publish_on_topic_publish": False,
    "play.clock_trigger_topics": [],
    "play.delay.sec": 0,
    "play.delay.nsec": 0,
    "play.playback_duration.sec": -1,
    "play.playback_duration.nsec": 0,
    "play.playback_until_timestamp.sec": 0,
    "play.playback_until_timestamp.nsec": -1,
    "play.start_paused": False,
    "play.start_offset.sec": 0,
    "play.start_offset.nsec": 0,
    "play.disable_keyboard_controls": False,
    "play.wait_acked_timeout.sec": 0,
    "play.wait_acked_timeout.nsec": -1,
    "play.disable_loan_message": False,
    "play.service_requests_source": "SERVICE_INTROSPECTION",
    "play.publish_service_request": False,
    "play.publish_service_requests": False,
    "play.send_actions_as_client": False,
    "play.message_order": "RECEIVED_TIMESTAMP",
    "play.progress_bar_update_rate": 3,
    "play.progress_bar_separation_lines": 2,
    "storage.uri": "",
    "storage.storage_id": "",
    "storage.storage_config_uri": "",
    "storage.max_bagfile_size": 0,
    "storage.max_bagfile_duration": 0,
    "storage.max_bag_files": 0,
    "storage.max_cache_size": 100 * 1024 * 1024,
    "storage.max_cache_duration": 0,
    "storage.storage_preset_profile": "",
    "storage.snapshot_mode": False,
    "storage.custom_data": [],
    "storage.start_time_ns": -1,
    "storage.end_time_ns": -1,
}
# Other values: those that would change the playback of rosbag2, and that this one does not have.
REFUSED: dict[str, tuple[Any, str]] = {
    "play.node_prefix": ("test", "-r __node:=NAME"),
    "play.topic_remapping_options": (["a:=b"], "-r FROM:=TO"),
    "play.topics_regex_to_filter": (".*", "play.regex_to_filter"),
    "play.topics_regex_to_exclude": (".*", "play.exclude_regex_to_filter"),
    "play.services_to_filter": (["/service"], "ros2 bag play"),
    "play.actions_to_filter": (["/action"], "ros2 bag play"),
    "play.publish_service_request": (True, "give false"),
    "play.publish_service_requests": (True, "give false"),
    "play.send_actions_as_client": (True, "give false"),
    "play.message_order": ("SENT_TIMESTAMP", "log times"),
    "play.progress_bar_update_rate": (10, "/diagnostics"),
    "storage.storage_config_uri": ("storage.yaml", "without rosbag2's storage plugins"),
    "storage.start_time_ns": (5, "play.start_offset"),
    "storage.end_time_ns": (5, "play.playback_until_timestamp"),
}
WITHOUT_EFFECT: dict[str, Any] = {
    "play.disable_keyboard_controls": True,
    "play.disable_loan_message": True,
    "play.exclude_services_to_filter": ["/service"],
    "play.exclude_actions_to_filter": ["/action"],
    "play.service_requests_source": "CLIENT_INTROSPECTION",
    "play.progress_bar_separation_lines": 5,
    "storage.max_bagfile_size": 12345,
    "storage.max_bagfile_duration": 54321,
    "storage.max_bag_files": 3,
    "storage.max_cache_size": 9898,
    "storage.max_cache_duration": 7,
    "storage.storage_preset_profile": "resilient",
    "storage.snapshot_mode": True,
    "storage.custom_data": ["key=value"],
}


def test_a_file_with_all_defaults_of_rosbag2_is_accepted() -> None:
    assert set(check_given(DEFAULTS, KNOWN)) == DEFAULTS.keys() - KNOWN - REFUSED.keys()


def test_each_parameter_is_honoured_refused_or_without_effect() -> None:
    assert DEFAULTS.keys() <= KNOWN | REFUSED.keys() | WITHOUT_EFFECT.keys()
    assert not KNOWN & (REFUSED.keys() | WITHOUT_EFFECT.keys())


@pytest.mark.parametrize("name", REFUSED)
def test_a_value_that_would_change_the_playback_is_refused_with_advice(name: str) -> None:
    value, advice = REFUSED[name]
    with pytest.raises(RequestError) as error:
        check_given({name: value}, KNOWN)
    assert str(error.value).startswith(f"{name}: {value!r} is not accepted, give ") and advice in str(error.value)


def test_values_without_effect_are_named_whatever_they_are() -> None:
    assert check_given(WITHOUT_EFFECT, KNOWN) == sorted(WITHOUT_EFFECT)


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        (
            "play.nonsense",
            "give a name listed in docs/reference/push_replay.md: push_replay has no parameter play.nonsense",
        ),
        ("play.ratte", "give play.rate"),
        ("storage.urri", "give storage.uri"),
        ("play.progress_bar", "push_replay has no parameter play.progress_bar"),
    ],
)
def test_an_unknown_name_is_refused_with_similar_ones(name: str, advice: str) -> None:
    with pytest.raises(RequestError) as error:
        check_given({name: 1}, KNOWN)
    assert error.value.field == name and advice in str(error.value)


def test_other_parameters_are_left_to_ros() -> None:
    assert check_given({"use_sim_time": True, "qos_overrides./a.publisher.depth": 3, "display": 1}, KNOWN) == []


def options(**given: Any) -> Any:
    values = {
        param.name: [t for t in param.default if t] if isinstance(param.default, list) else param.default
        for param in PARAMETERS
    }
    times = {name.removesuffix(".sec"): 0 for name in values if name.endswith(".sec")}
    return replay_options(values | {name.replace("__", "."): value for name, value in given.items()}, times)


def test_a_parameter_file_of_rosbag2s_player_gives_the_options(tmp_path: Path) -> None:
    file = tmp_path / "player.yaml"
    given = DEFAULTS | {"storage.uri": "/bag", "play.rate": 13.0, "play.delay.nsec": 1, "play.loop": True}
    file.write_text(yaml.safe_dump({"rosbag2_player": {"ros__parameters": nested(given)}}))
    read = options_of("--params-file", str(file))
    assert (read.recording, read.rate, read.delay, read.loop) == (Path("/bag"), 13.0, 1, True)
    assert (read.clock_frequency, read.acked_timeout, read.filter.topics) == (0.0, -1, ())


def test_a_time_in_seconds_replaces_only_a_pair_of_defaults() -> None:
    zero = ("-p", "recording:=a", "-p", "play.delay:=2.5", "-p", "play.delay.sec:=0", "-p", "play.delay.nsec:=0")
    assert options_of(*zero).delay == 2_500_000_000
    with pytest.raises(RequestError, match=r"give either play\.delay in seconds or play\.delay\.nsec"):
        options_of("-p", "recording:=a", "-p", "play.delay:=2.5", "-p", "play.delay.nsec:=5")


def options_of(*ros_args: str) -> Any:
    """The options that a node of these arguments reads."""
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    context = Context()
    context.init(args=["--ros-args", *ros_args], domain_id=free_domain())
    node = Node("rosbag2_player", context=context, enable_rosout=False, start_parameter_services=False)
    try:
        return read_options(node)
    finally:
        node.destroy_node()
        context.try_shutdown()


def nested(flat: dict[str, Any]) -> dict[str, Any]:
    tree: dict[str, Any] = {}
    for name, value in flat.items():
        *groups, last = name.split(".")
        place = tree
        for group in groups:
            place = place.setdefault(group, {})
        place[last] = value
    return tree


def test_storage_uri_is_another_name_of_the_recording() -> None:
    for given in ({"recording": "~/a"}, {"storage__uri": "~/a"}, {"recording": "~/a/", "storage__uri": "~/a"}):
        assert options(**given).recording == Path("~/a").expanduser()
    with pytest.raises(RequestError, match=r"storage\.uri: 'b' is not accepted, give one recording: recording is 'a'"):
        options(recording="a", storage__uri="b")
    with pytest.raises(RequestError, match="recording: '' is not accepted"):
        options()


@pytest.mark.parametrize(
    ("on_publish", "topics", "triggers"),
    [
        (False, [], ()),
        (False, ["/a"], ()),  # as in rosbag2, the list alone does nothing
        (True, [], ("/a", "/b")),
        (True, ["/a"], ("/a",)),
        (True, ["b"], ("/b",)),
    ],
)
def test_clock_is_published_before_the_chosen_topics(
    on_publish: bool, topics: list[str], triggers: tuple[str, ...]
) -> None:
    chosen = options(recording="a", play__clock_publish_on_topic_publish=on_publish, play__clock_trigger_topics=topics)
    assert tuple(topic for topic in ("/a", "/b") if chosen.triggers_clock(topic)) == triggers

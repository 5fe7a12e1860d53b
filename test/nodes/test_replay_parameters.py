# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of push_replay: refused values, and the shipped configuration."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import pytest
from hosted_nodes import hosted_node, refused_start
from replay_bags import push_messages, write_bag
from ros_harness import free_domain

from push_predictor.nodes import runtime
from push_predictor.nodes.parameter_tables import PUSH_RECORDER, PUSH_REPLAY, PUSH_VALIDATOR
from push_predictor.nodes.parameters import Param, native
from push_predictor.nodes.push_replay import PushReplay
from push_predictor.nodes.replay_topics import is_played
from push_predictor.recordings.topics import KEYS


@pytest.fixture(scope="module")
def second(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bag(tmp_path_factory.mktemp("bags") / "second.mcap", push_messages(1.0))


@pytest.mark.parametrize(
    ("params", "text"),
    [
        ({}, "recording: '' is not accepted"),
        ({"recording": "/nowhere.mcap"}, "/nowhere.mcap: cannot be read"),
        ({"play.rate": -1.0}, "play.rate: -1.0 is not accepted, give a number from 1e-06 up to 1e+06"),
        ({"up": "q"}, "up: 'q' is not accepted, give x, y, z, -x, -y or -z, of some streams STREAM=AXIS"),
        ({"stamp": "sent"}, "stamp: 'sent' is not accepted, give header or log"),
        ({"play.rate": "fast"}, "play.rate: 'fast' is not accepted"),
        ({"play.delay": -1.0}, "play.delay: -1.0 is not accepted, give a number from 0"),
        ({"play.read_ahead_queue_size": 0}, "play.read_ahead_queue_size: 0 is not accepted"),
        ({"play.regex_to_filter": "("}, "play.regex_to_filter: '(' is not accepted"),
        ({"rig": "/nowhere.yaml"}, "/nowhere.yaml: the rig cannot be read"),
        ({"qos_overrides./slider/pose.publisher.reliability": "perhaps"}, "reliability"),
    ],
)
def test_bad_parameter_ends_in_one_line_and_status_1(
    second: Path, params: dict[str, Any], text: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    given = {"recording": second, **params} if params else {}
    line = refused_start(partial(runtime.run, "push_replay", PushReplay), monkeypatch, capfd, **given)
    assert line.startswith("push_replay: ") and text in line


def test_every_node_that_reads_streams_has_a_parameter_for_each_option_of_topics() -> None:
    recorder, replay, validator = ({p.name for p in each} for each in (PUSH_RECORDER, PUSH_REPLAY, PUSH_VALIDATOR))
    assert set(KEYS) <= recorder and set(KEYS) <= validator
    assert set(KEYS) - {"wrench_bias", "covariate_topics"} <= replay


@pytest.mark.parametrize("table", [PUSH_RECORDER, PUSH_REPLAY, PUSH_VALIDATOR])
def test_a_bare_y_in_a_parameter_file_is_the_axis(table: tuple[Param, ...]) -> None:
    by_name = {param.name: param for param in table}
    for given in (True, "y"):
        assert by_name["up"].allows(given) and native(by_name["up"], given) == "y"
    assert not by_name["up"].allows(False) and not by_name["stamp"].allows(True)


@pytest.mark.parametrize(
    ("given", "played"),
    [
        ({}, "slider pusher wrench"),
        ({"exclude_regex_to_filter": ".*pose"}, "wrench"),
        ({"exclude_topics_to_filter": ["slider/pose"]}, "pusher wrench"),
        ({"topics_to_filter": ["/slider/pose"], "regex_to_filter": ".*wrench"}, "slider wrench"),
        ({"topics_to_filter": ["/slider/pose"], "exclude_regex_to_filter": ".*slider.*"}, ""),
        ({"regex_to_filter": "wrench"}, ""),
    ],
)
def test_topics_are_filtered_as_rosbag2_does(given: dict[str, Any], played: str) -> None:
    none: dict[str, Any] = {"regex_to_filter": "", "topics_to_filter": []}
    none |= {f"exclude_{name}": value for name, value in none.items()}
    values = {f"play.{name}": value for name, value in {**none, **given}.items()}
    topics = {"slider": "/slider/pose", "pusher": "/pusher/pose", "wrench": "/pusher/wrench"}
    assert [name for name, topic in topics.items() if is_played(topic, values)] == played.split()


@pytest.mark.parametrize(
    ("executable", "wanted", "nearest"),
    [
        ("predict_server", {"modls": [""]}, "models"),
        ("push_recorder", {"slyder_topc": "a", "covariate_topics": []}, "slider_topic"),
        ("push_validator", {"slyder_topc": "a", "report": False}, "slider_topic"),
    ],
)
def test_each_node_warns_once_of_a_parameter_that_it_does_not_know(
    executable: str, wanted: dict[str, Any], nearest: str, tmp_path: Path
) -> None:
    given = {"qos_overrides./a.subscription.depth": 5, "use_sim_time": True, **wanted}
    given |= {"bag": tmp_path / "bag"} if executable == "push_recorder" else {}
    with hosted_node(executable, domain=free_domain(), params=given) as node:
        found = [line.partition("parameter ")[2] for line in node.text().splitlines() if "is unknown and" in line]
    (unknown,) = (name for name in wanted if name in ("modls", "slyder_topc"))
    assert found == [f"{unknown!r} is unknown and ignored; the nearest name is {nearest!r}"]


def test_a_rate_without_its_prefix_is_not_taken_in_silence(second: Path) -> None:
    with hosted_node("push_replay", "-p", "rate:=10", domain=free_domain(), params={"recording": second}) as node:
        node.wait_for_text("parameter 'rate' is unknown and ignored; the nearest name is 'play.rate'")

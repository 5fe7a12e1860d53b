# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The topics that the recorder records, and the definitions of their types."""

from __future__ import annotations

from pathlib import Path

import pytest

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.message_types import definition_text
from push_predictor.recordings.decoder.sources import RecordedTopic, resolved, topics_to_record
from push_predictor.recordings.topics import Topics


def test_default_topics_are_recorded_and_the_wrench_may_be_missing() -> None:
    wanted = topics_to_record(Topics(), with_wrench=False)
    assert [(topic.name, topic.expected) for topic in wanted] == [
        ("slider/pose", True),
        ("pusher/pose", True),
        ("pusher/wrench", False),
    ]


def test_each_topic_is_recorded_once_and_tf_with_its_static_part() -> None:
    wanted = topics_to_record(Topics("/tf:block", "/tf:tool0", "/state.wrench", ("/state.current",)))
    assert wanted == (
        RecordedTopic("/tf", ("slider", "pusher")),
        RecordedTopic("/tf_static", ("slider", "pusher"), expected=False, static=True),
        RecordedTopic("/state", ("wrench", "covariate")),
    )


@pytest.mark.parametrize("given", [Topics(world="map"), Topics(wrench_frame="ft_sensor")])
def test_tf_is_recorded_if_a_reader_will_turn_by_it(given: Topics) -> None:
    names = [topic.name for topic in topics_to_record(given)]
    assert names[-2:] == ["/tf", "/tf_static"]


@pytest.mark.parametrize("given", [Topics(), Topics(wrench_frame="tip"), Topics(wrench_frame="world")])
def test_tf_is_not_recorded_where_nothing_is_turned_by_it(given: Topics) -> None:
    assert "/tf" not in [topic.name for topic in topics_to_record(given)]


def test_a_topic_is_expected_if_one_of_its_streams_is() -> None:
    wanted = topics_to_record(Topics("/state.pose", "/state.tip", "/state.wrench"), with_wrench=False)
    assert wanted == (RecordedTopic("/state", ("slider", "pusher", "wrench"), expected=True),)


def test_names_are_resolved_and_fields_and_frames_stay() -> None:
    given = Topics("", "/tf:tool0", "netft.wrench", ("driver.currents[2]",), "map")
    found = resolved(given, lambda name: name if name.startswith("/") else f"/cell/{name}")
    expected = Topics("/cell/slider/pose", "/tf:tool0", "/cell/netft.wrench", ("/cell/driver.currents[2]",), "map")
    assert found == expected


def test_definitions_contain_each_inner_type_once(tmp_path: Path) -> None:
    for name, text in {"A": "B one\nB[] two\nother/C c\n", "B": "int32 COUNT=3\nfloat64 x"}.items():
        (tmp_path / "lab" / "msg").mkdir(parents=True, exist_ok=True)
        (tmp_path / "lab" / "msg" / f"{name}.msg").write_text(text)
    with pytest.raises(RecordingError, match=r"other/msg/C\.msg: not found in"):
        definition_text("lab/msg/A", [tmp_path])
    (tmp_path / "other" / "msg").mkdir(parents=True)
    (tmp_path / "other" / "msg" / "C.msg").write_text("string name\n")
    rule = "=" * 80
    assert definition_text("lab/msg/A", [Path("/nowhere"), tmp_path]) == (
        f"B one\nB[] two\nother/C c\n{rule}\nMSG: lab/B\nint32 COUNT=3\nfloat64 x\n{rule}\nMSG: other/C\nstring name\n"
    )
    (tmp_path / "other" / "msg" / "C.msg").write_bytes(b"# \xff\nstring name\n")
    with pytest.raises(RecordingError, match=r"other/msg/C\.msg cannot be read: 'utf-8' codec"):
        definition_text("lab/msg/A", [tmp_path])

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Which topics of a bag contain the streams of pushes: named, or usual."""

from __future__ import annotations

from push_predictor.recordings.topics import Topics
from push_predictor.replay.source import missing_poses, push_topics

USUAL = ["/pusher/pose", "/pusher/wrench", "/slider/pose", "/surface/temperature"]
LAB = ["/netft", "/robot_state", "/tf", "/tf_static", "/vicon/block/block"]
NAMED = Topics("vicon/block/block", "/tf:tool0", "/netft.wrench")


def test_without_names_the_usual_topics_are_found() -> None:
    assert push_topics(USUAL, Topics()) == {"/pusher/pose", "/pusher/wrench", "/slider/pose"}
    assert missing_poses(USUAL, Topics()) == []
    assert push_topics(LAB, Topics()) == frozenset() and missing_poses(LAB, Topics()) == ["slider/pose", "pusher/pose"]


def test_a_frame_needs_its_static_transforms_and_a_field_its_topic() -> None:
    assert push_topics(LAB, NAMED) == {"/netft", "/tf", "/tf_static", "/vicon/block/block"}
    assert missing_poses(LAB, NAMED) == []
    assert push_topics(LAB, Topics("/robot_state.pose")) == {"/robot_state"}


def test_a_missing_topic_is_named_as_it_was_given_and_the_wrench_is_optional() -> None:
    assert missing_poses(LAB, Topics("/vicon/block/blok", "/tf:tool0")) == ["/vicon/block/blok"]
    assert missing_poses([topic for topic in LAB if topic != "/netft"], NAMED) == []
    assert push_topics(["/t", "/t_static"], Topics("/t", "/u")) == {"/t"}

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A body on the robot's hand moves with the tip where a pushed slider would rest; a pushed slider does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mistakes import on_hand, stream_part
from synthetic import RADIUS, Push, translating_push

from push_predictor.recordings.checks.frames import fixed_to_tip
from push_predictor.recordings.checks.motion import motion_of
from push_predictor.recordings.read import require_rig
from push_predictor.recordings.streams import Recording

LONG = Push(end=10.5, speed=0.1)  # a metre
TOUCHING = 0.045 + RADIUS  # m from the slider's centre to the tip
AHEAD = np.array([1.0, 0.0])  # the direction of the push, against the first side of the square


def refused(recording: Recording) -> bool:
    return fixed_to_tip(motion_of(recording, require_rig(recording)), require_rig(recording)) is not None


def trimmed(recording: Recording) -> Recording:
    """From first touch to last contact."""
    begin, end = 0.6 / 11.3, 10.4 / 11.3
    slider, pusher = (stream_part(poses, begin, end) for poses in (recording.slider, recording.pusher))
    return replace(recording, slider=slider, pusher=pusher)


@pytest.mark.parametrize("cut", [trimmed, lambda recording: recording])
def test_a_slider_that_is_pushed_from_first_to_last_is_no_body_on_the_hand(cut: object) -> None:
    """In its frame the tip does not move either."""
    assert not refused(cut(translating_push(LONG)))  # type: ignore[operator]


def test_a_body_that_never_touches_the_tip_is_refused_without_a_way_back() -> None:
    push = trimmed(translating_push(LONG))
    assert not refused(on_hand(push, tuple(TOUCHING * AHEAD)))  # nothing distinguishes it from a slider
    rig = require_rig(push)
    finding = fixed_to_tip(motion_of(on_hand(push, tuple((TOUCHING + 0.03) * AHEAD)), rig), rig)
    assert finding is not None and finding.name == "another_body" and finding.severity == "refused"
    assert finding.values["spread"].value < 1e-3


def test_a_body_that_follows_the_tip_on_its_way_back_is_refused() -> None:
    """A tip that moves away pulls nothing."""
    assert refused(on_hand(translating_push(), tuple(TOUCHING * AHEAD)))
    assert not refused(translating_push())


def test_a_body_that_the_lifted_tip_carries_is_refused() -> None:
    push = trimmed(translating_push(LONG))
    raised = replace(push.pusher, z=np.where(np.arange(len(push.pusher)) > 0.8 * len(push.pusher), 0.03, 0.0))
    assert refused(on_hand(replace(push, pusher=raised), tuple(TOUCHING * AHEAD)))


@pytest.mark.parametrize(
    ("push", "size", "judged"),
    [(LONG, 0.03, False), (LONG, 0.012, False), (LONG, 0.008, True), (Push(end=0.9), 0.004, False)],
)
def test_a_body_whose_place_at_the_tip_varies_is_not_judged(push: Push, size: float, judged: bool) -> None:
    """By more than 10 mm, or by as much as the tip travels."""
    body = on_hand(translating_push(push), (0.12, 0.0))
    swing = size * np.sin(np.linspace(0.0, 60.0, len(body.slider)))
    assert refused(replace(body, slider=replace(body.slider, x=body.slider.x + swing))) is judged

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rig of a node from the topic rig: what is taken, and what is stated while there is none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import ros_harness as harness
from synthetic import square_rig

from msg_adapters.rigs import rig_to_message
from push_predictor.nodes import rig_source
from push_predictor.nodes.qos import LATCHED
from push_predictor.nodes.rig_source import NO_RIG, VOLATILE, RigSource
from push_predictor.recordings.rig import save_rig
from push_predictor_interfaces.msg import PushRig

pytestmark = pytest.mark.ros


def test_the_topic_gives_the_rig_and_states_what_is_wrong(tmp_path: Path) -> None:
    with harness.ros_context(harness.free_domain()) as node:
        rigs, own = RigSource(node, ""), square_rig()
        assert (rigs.rig, rigs.missing) == (None, NO_RIG)
        volatile = node.create_publisher(PushRig, "rig", 1)
        assert harness.wait_until(lambda: rigs.problem == VOLATILE)
        node.destroy_publisher(volatile)

        def taken() -> bool:
            rigs.work()
            return rigs.rig is not None

        latched = node.create_publisher(PushRig, "rig", LATCHED)
        latched.publish(rig_to_message(own))
        assert harness.wait_until(taken)
        assert rigs.rig is not None
        assert (rigs.problem, rigs.missing, rigs.rig.to_record()) == ("", "", own.to_record())
        latched.publish(PushRig(shape="nothing"))

        def refused() -> bool:
            rigs.work()
            return bool(rigs.problem)

        assert harness.wait_until(refused) and "topic rig: push_rig" in rigs.problem
        assert rigs.missing == "", "the earlier rig stays"
        save_rig(own, tmp_path / "rig.yaml")
        of_file = RigSource(node, str(tmp_path / "rig.yaml"))
        of_file.work()
        assert of_file.rig is not None and of_file.problem == ""


def test_a_rig_that_is_published_again_stays_the_same_object(monkeypatch: pytest.MonkeyPatch) -> None:
    node: Any = SimpleNamespace(create_subscription=lambda *_, **__: None)
    rigs, own = RigSource(node, ""), square_rig()
    seen = []
    for published in (own, own, replace(own, pusher_radius=0.01)):
        monkeypatch.setattr(rig_source, "take_all", lambda _, rig=published: [(rig_to_message(rig),)])
        rigs.work()
        seen.append(rigs.rig)
    assert seen[0] is seen[1] and seen[2] is not seen[1] and seen[2].pusher_radius == 0.01

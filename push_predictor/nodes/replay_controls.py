# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""rosbag2's player services; each calls the player's method of the same name."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from functools import partial
from types import ModuleType
from typing import Any

from builtin_interfaces.msg import Duration, Time
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node

from msg_adapters import stamp_to_ns
from push_predictor.errors import BusyError, NothingLeftError, NotPausedError, PushPredictorError, RequestError
from push_predictor.nodes.runtime import refusal
from push_predictor.replay.player import PlayRange, ReplayPlayer
from push_predictor_interfaces import srv as own_types


class ReplayControls:
    """The player services of a node, with private names.

    They have rosbag2's types where rosbag2_interfaces is installed, else this project's, which are the same fields and
    a message.
    """

    def __init__(self, node: Node, player: ReplayPlayer) -> None:
        self._node, self._player = node, player
        types = _imported_rosbag2() or own_types
        waiting = MutuallyExclusiveCallbackGroup()  # of those that wait for subscribers
        handlers: dict[str, Callable[[Any, Any], object]] = {
            "Pause": lambda request, response: player.pause(),
            "Resume": lambda request, response: player.resume(),
            "TogglePaused": lambda request, response: player.toggle_paused(),
            "IsPaused": lambda request, response: setattr(response, "paused", player.paused),
            "GetRate": lambda request, response: setattr(response, "rate", player.rate),
            "SetRate": self._set_rate,
            "Play": self._play,
            "PlayNext": self._play_next,
            "Burst": self._burst,
            "Seek": lambda request, response: player.seek(stamp_to_ns(request.time)),
            "Stop": lambda request, response: player.stop(),
        }
        for kind, handler in handlers.items():
            name = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", kind).lower()
            group = waiting if kind in ("PlayNext", "Burst") else None
            callback = partial(self._guarded, handler)
            node.create_service(getattr(types, kind), f"~/{name}", callback, callback_group=group)

    def _guarded(self, handler: Callable[[Any, Any], object], request: Any, response: Any) -> Any:
        try:
            handler(request, response)
        except Exception as error:
            return refusal(error, response, self._node.get_logger())
        if hasattr(response, "success"):
            response.success = True
        return response

    def _set_rate(self, request: Any, response: Any) -> None:
        if not self._player.set_rate(request.rate):
            raise RequestError("rate", request.rate, "a finite number above 0")

    def _play(self, request: Any, response: Any) -> None:
        duration, until = _limit(request.playback_duration), _limit(request.playback_until_timestamp)
        if not self._player.play(PlayRange(max(0, stamp_to_ns(request.start_offset)), duration, until)):
            raise BusyError("a playback is running: end it with ~/stop")

    def _play_next(self, request: Any, response: Any) -> None:
        if not self._player.play_next():
            raise self._nothing_published()

    def _burst(self, request: Any, response: Any) -> None:
        response.actually_burst = self._player.burst(request.num_messages)
        if not response.actually_burst:
            raise self._nothing_published()

    def _nothing_published(self) -> PushPredictorError:
        if not self._player.paused:
            return NotPausedError("the replay is not paused: pause it with ~/pause")
        return NothingLeftError("no message is left: start again with ~/play or ~/seek")


def _imported_rosbag2() -> ModuleType | None:
    try:
        return importlib.import_module("rosbag2_interfaces.srv")
    except ImportError:
        return None


def _limit(time: Time | Duration) -> int | None:
    """None for 0: an empty request plays everything."""
    return value if (value := stamp_to_ns(time)) > 0 else None

"""rosbag2's player services; each calls the player's method of the same name."""

from __future__ import annotations

from typing import Any

from builtin_interfaces.msg import Duration, Time
from rclpy.node import Node

from push_predictor.errors import RequestError
from push_predictor.replay.clock import SECOND
from push_predictor.replay.play_range import PlayRange
from push_predictor.replay.player import ReplayPlayer
from push_predictor_interfaces.srv import (
    Burst,
    GetRate,
    IsPaused,
    Pause,
    Play,
    PlayNext,
    Resume,
    Seek,
    SetRate,
    Stop,
    TogglePaused,
)


class ReplayControls:
    """The player services of a node, with private names."""

    def __init__(self, node: Node, player: ReplayPlayer, restamps: bool) -> None:
        self._node, self._player, self._restamps = node, player, restamps
        for kind, name, callback in (
            (Pause, "pause", self._pause),
            (Resume, "resume", self._resume),
            (TogglePaused, "toggle_paused", self._toggle_paused),
            (IsPaused, "is_paused", self._is_paused),
            (GetRate, "get_rate", self._get_rate),
            (SetRate, "set_rate", self._set_rate),
            (Play, "play", self._play),
            (PlayNext, "play_next", self._play_next),
            (Burst, "burst", self._burst),
            (Seek, "seek", self._seek),
            (Stop, "stop", self._stop),
        ):
            node.create_service(kind, f"~/{name}", callback)

    def _pause(self, request: Any, response: Any) -> Any:
        self._player.pause()
        return response

    def _resume(self, request: Any, response: Any) -> Any:
        self._player.resume()
        return response

    def _toggle_paused(self, request: Any, response: Any) -> Any:
        self._player.toggle_paused()
        return response

    def _is_paused(self, request: Any, response: Any) -> Any:
        response.paused = self._player.paused
        return response

    def _get_rate(self, request: Any, response: Any) -> Any:
        response.rate = self._player.rate
        return response

    def _set_rate(self, request: Any, response: Any) -> Any:
        if self._restamps and request.rate != 1.0:
            refusal = RequestError("set_rate", request.rate, "1.0, which restamp requires")
            self._node.get_logger().warning(str(refusal))
            response.success = False
        else:
            response.success = self._player.set_rate(request.rate)
        return response

    def _play(self, request: Any, response: Any) -> Any:
        response.success = self._player.play(
            PlayRange(
                max(0, _nanoseconds(request.start_offset)),
                _limit(request.playback_duration),
                _limit(request.playback_until_timestamp),
            )
        )
        return response

    def _play_next(self, request: Any, response: Any) -> Any:
        response.success = self._player.play_next()
        return response

    def _burst(self, request: Any, response: Any) -> Any:
        response.actually_burst = self._player.burst(request.num_messages)
        return response

    def _seek(self, request: Any, response: Any) -> Any:
        self._player.seek(_nanoseconds(request.time))
        response.success = True
        return response

    def _stop(self, request: Any, response: Any) -> Any:
        self._player.stop()
        return response


def _nanoseconds(time: Time | Duration) -> int:
    return int(time.sec) * SECOND + int(time.nanosec)


def _limit(time: Time | Duration) -> int | None:
    """None for 0: an empty request plays everything."""
    return value if (value := _nanoseconds(time)) > 0 else None

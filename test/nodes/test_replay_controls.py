# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The player services without a node process: refusals with their code, and the types of rosbag2 where installed."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest.mock import create_autospec

import pytest
from builtin_interfaces.msg import Duration, Time

from push_predictor.nodes.replay_controls import ReplayControls
from push_predictor.replay.player import PlayRange, ReplayPlayer
from push_predictor_interfaces import srv

NAMES = {
    "burst": srv.Burst,
    "get_rate": srv.GetRate,
    "is_paused": srv.IsPaused,
    "pause": srv.Pause,
    "play": srv.Play,
    "play_next": srv.PlayNext,
    "resume": srv.Resume,
    "seek": srv.Seek,
    "set_rate": srv.SetRate,
    "stop": srv.Stop,
    "toggle_paused": srv.TogglePaused,
}


class Desk:
    """Controls of a paused player with nothing left to play, that plays already; what the node logged."""

    def __init__(self) -> None:
        self.services: dict[str, tuple[Any, Callable[[Any, Any], Any]]] = {}
        self.logged: list[str] = []
        self.player = create_autospec(ReplayPlayer, instance=True, paused=True, rate=1.0)
        for refused in ("play", "set_rate", "play_next"):
            getattr(self.player, refused).return_value = False
        self.player.burst.return_value = 0
        ReplayControls(self, self.player)  # type: ignore[arg-type]  # in place of a node

    def create_service(self, kind: Any, name: str, callback: Callable[[Any, Any], Any], **_: object) -> None:
        self.services[name] = (kind, callback)

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=lambda text, **_: self.logged.append(text), error=self.logged.append)

    def call(self, name: str, **fields: Any) -> Any:
        kind, callback = self.services[f"~/{name}"]
        return callback(kind.Request(**fields), kind.Response())


@pytest.fixture(autouse=True)
def without_rosbag2(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide rosbag2_interfaces, installed or not."""
    monkeypatch.setitem(sys.modules, "rosbag2_interfaces.srv", None)


def test_every_service_has_a_private_name_and_asks_the_player() -> None:
    desk = Desk()
    assert {name: kind for name, (kind, _) in desk.services.items()} == {
        f"~/{name}": kind for name, kind in NAMES.items()
    }
    for accepted in ("play", "set_rate", "play_next"):
        getattr(desk.player, accepted).return_value = True
    desk.player.burst.return_value = 2
    responses = {name: desk.call(name) for name in NAMES}
    for name, response in responses.items():
        assert (response.error_code, response.message, getattr(response, "success", True)) == (response.NONE, "", True)
        assert name in ("is_paused", "get_rate") or getattr(desk.player, name).call_count == 1
    assert responses["get_rate"].rate == 1.0 and responses["is_paused"].paused
    assert responses["burst"].actually_burst == 2 and not desk.logged


def test_requests_are_passed_on() -> None:
    desk = Desk()
    desk.call("set_rate", rate=2.0)
    desk.call("burst", num_messages=7)
    desk.call("seek", time=Time(sec=3, nanosec=4))
    desk.call("play", start_offset=Time(sec=1), playback_duration=Duration(sec=2))
    player = desk.player
    player.set_rate.assert_called_with(2.0)
    player.burst.assert_called_with(7)
    player.seek.assert_called_with(3_000_000_004)
    player.play.assert_called_with(PlayRange(10**9, 2 * 10**9, None))


@pytest.mark.parametrize(
    ("name", "paused", "code", "words"),
    [
        ("set_rate", True, "INVALID_REQUEST", "rate: 0.0 is not accepted, give a finite number above 0"),
        ("play", True, "BUSY", "~/stop"),
        ("play_next", True, "NOTHING_LEFT", "no message is left"),
        ("burst", True, "NOTHING_LEFT", "no message is left"),
        ("play_next", False, "NOT_PAUSED", "~/pause"),
        ("burst", False, "NOT_PAUSED", "~/pause"),
    ],
)
def test_a_refusal_has_its_reason_and_code(name: str, paused: bool, code: str, words: str) -> None:
    desk = Desk()
    desk.player.paused = paused
    response = desk.call(name)
    assert not getattr(response, "success", False) and response.error_code == getattr(response, code)
    assert words in response.message and desk.logged == [response.message]


@pytest.mark.parametrize("name", NAMES)
def test_an_unforeseen_failure_does_not_leave_the_callback_and_the_client_sees_it(name: str) -> None:
    desk = Desk()
    for method in NAMES.keys() - {"is_paused", "get_rate"}:
        getattr(desk.player, method).side_effect = ZeroDivisionError
    del desk.player.paused, desk.player.rate
    response = desk.call(name)
    error = "AttributeError" if name in ("is_paused", "get_rate") else "ZeroDivisionError"
    assert response.error_code == response.INTERNAL_ERROR and error in response.message and error in desk.logged[-1]
    assert not any(getattr(response, field, False) for field in ("success", "paused", "rate", "actually_burst"))


# --- rosbag2's types ----------------------------------------------------------------------------------------------


def of_rosbag2(kind: type) -> Any:
    """A stand-in for rosbag2's type: the fields of this project's type without message and error_code."""

    class Request(kind.Request):  # type: ignore[name-defined]  # a class that is an argument
        """The fields are the same."""

    declared = kind.Response.get_fields_and_field_types()  # type: ignore[attr-defined]  # of a service's type
    names = [n for n in declared if n not in ("message", "error_code")]

    class Response:
        """Only the fields that rosbag2 has."""

        __slots__ = names

        def __init__(self, **fields: Any) -> None:
            for name in names:
                setattr(self, name, fields.pop(name, 0))
            assert not fields

    return SimpleNamespace(Request=Request, Response=Response)


@pytest.fixture
def rosbag2(without_rosbag2: None, monkeypatch: pytest.MonkeyPatch) -> Desk:
    """Controls where rosbag2_interfaces is installed: a stand-in, because the ROS wheels lack that package."""
    types = ModuleType("rosbag2_interfaces.srv")
    for kind in NAMES.values():
        setattr(types, kind.__name__, of_rosbag2(kind))
    monkeypatch.setitem(sys.modules, "rosbag2_interfaces", ModuleType("rosbag2_interfaces"))
    monkeypatch.setitem(sys.modules, "rosbag2_interfaces.srv", types)
    return Desk()


def test_where_rosbag2s_types_are_installed_the_services_have_them_and_need_only_their_fields(rosbag2: Desk) -> None:
    types = sys.modules["rosbag2_interfaces.srv"]
    assert all(rosbag2.services[f"~/{name}"][0] is getattr(types, kind.__name__) for name, kind in NAMES.items())
    assert rosbag2.call("seek").success is True
    assert rosbag2.call("set_rate", rate=-1.0).success is rosbag2.call("play").success is False
    assert rosbag2.call("burst").actually_burst == 0
    rosbag2.player.stop.side_effect = ZeroDivisionError
    rosbag2.call("stop")  # fails, and is logged
    assert "ZeroDivisionError" in rosbag2.logged[-1]

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The player services without a node process: refusals with their code, and the types of rosbag2 where installed."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from push_predictor.nodes.replay_controls import ReplayControls
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


class FakeNode:
    """Records the services that are created on it, and what is logged."""

    def __init__(self) -> None:
        self.services: dict[str, tuple[Any, Callable[[Any, Any], Any]]] = {}
        self.logged: list[str] = []

    def create_service(self, kind: Any, name: str, callback: Callable[[Any, Any], Any], **_: object) -> None:
        self.services[name] = (kind, callback)

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=lambda text, **_: self.logged.append(text), error=self.logged.append)


class FakePlayer:
    """A paused player with three messages left, that plays already."""

    def __init__(self) -> None:
        self.paused, self.rate, self.left, self.sought = True, 1.0, 3, 0

    def play(self, what: Any) -> bool:
        return False

    def pause(self) -> None:
        self.paused = True

    def resume(self) -> None:
        self.paused = False

    def set_rate(self, rate: float) -> bool:
        self.rate = rate if rate > 0.0 else self.rate
        return rate > 0.0

    def play_next(self) -> bool:
        return self.burst(1) == 1

    def burst(self, count: int) -> int:
        done = min(count or self.left, self.left) if self.paused else 0
        self.left -= done
        return done

    def seek(self, time: int) -> None:
        if time < 0:
            raise OSError("disk")
        self.sought = time

    def toggle_paused(self) -> None:
        self.paused = not self.paused

    def stop(self) -> None:
        raise ZeroDivisionError


class BrokenPlayer(FakePlayer):
    """Whatever is asked of it fails."""

    def __getattribute__(self, name: str) -> Any:
        raise ZeroDivisionError


class Desk:
    """Controls of a fake player, and a function that calls them."""

    def __init__(self, player: FakePlayer | None = None) -> None:
        self.node, self.player = FakeNode(), player or FakePlayer()
        ReplayControls(self.node, self.player)  # type: ignore[arg-type]  # fakes

    def call(self, name: str, **fields: Any) -> Any:
        return answer(self.node, name, **fields)


def answer(node: FakeNode, name: str, **fields: Any) -> Any:
    kind, callback = node.services[f"~/{name}"]
    return callback(kind.Request(**fields), kind.Response())


@pytest.fixture(autouse=True)
def without_rosbag2(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide rosbag2_interfaces, installed or not."""
    monkeypatch.setitem(sys.modules, "rosbag2_interfaces.srv", None)


def test_every_service_has_a_private_name() -> None:
    services = Desk().node.services
    assert {name: kind for name, (kind, _) in services.items()} == {f"~/{name}": kind for name, kind in NAMES.items()}


def test_an_accepted_control_has_no_error() -> None:
    desk = Desk()
    for response in (desk.call("set_rate", rate=2.0), desk.call("play_next"), desk.call("seek")):
        assert response.success and response.error_code == response.NONE and response.message == ""
    assert desk.call("get_rate").rate == 2.0 and desk.call("is_paused").paused
    for name in ("pause", "resume", "toggle_paused", "is_paused", "get_rate"):
        assert desk.call(name).error_code == response.NONE and desk.call(name).message == ""
    desk.call("pause")
    response = desk.call("burst", num_messages=2)
    assert response.actually_burst == 2 and response.error_code == response.NONE


def test_a_bad_rate_is_refused_with_its_reason() -> None:
    desk = Desk()
    response = desk.call("set_rate", rate=-1.0)
    assert not response.success and response.error_code == response.INVALID_REQUEST
    assert response.message == "rate: -1.0 is not accepted, give a finite number above 0"
    assert desk.player.rate == 1.0 and desk.node.logged == [response.message]


def test_a_second_playback_is_busy() -> None:
    response = Desk().call("play")
    assert not response.success and response.error_code == response.BUSY and "~/stop" in response.message


def test_the_code_of_an_empty_burst_states_whether_pause_would_help() -> None:
    desk = Desk()
    assert desk.call("burst").actually_burst == 3
    for response in (desk.call("play_next"), desk.call("burst")):
        assert response.error_code == response.NOTHING_LEFT
    desk.call("resume")
    for response in (desk.call("play_next"), desk.call("burst")):
        assert response.error_code == response.NOT_PAUSED and "pause" in response.message


@pytest.mark.parametrize("name", NAMES)
def test_an_unforeseen_failure_does_not_leave_the_callback_and_the_client_sees_it(name: str) -> None:
    desk = Desk(player=BrokenPlayer())
    response = desk.call(name)
    assert response.error_code == response.INTERNAL_ERROR and "ZeroDivisionError" in response.message
    assert not any(getattr(response, field, False) for field in ("success", "paused", "rate", "actually_burst"))
    assert "ZeroDivisionError" in desk.node.logged[-1]


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


def test_the_services_have_rosbag2s_types_where_these_are_installed(rosbag2: Desk) -> None:
    types = sys.modules["rosbag2_interfaces.srv"]
    assert all(rosbag2.node.services[f"~/{name}"][0] is getattr(types, kind.__name__) for name, kind in NAMES.items())
    assert rosbag2.call("set_rate", rate=3.0).success and rosbag2.player.rate == 3.0
    assert rosbag2.call("burst", num_messages=2).actually_burst == 2 and rosbag2.player.left == 1
    assert rosbag2.call("play_next").success


def test_a_refusal_needs_only_the_fields_of_rosbag2(rosbag2: Desk) -> None:
    assert rosbag2.call("set_rate", rate=-1.0).success is False
    assert rosbag2.call("play").success is False
    rosbag2.call("resume")
    assert rosbag2.call("burst").actually_burst == 0
    rosbag2.call("stop")  # fails, and is logged
    assert "ZeroDivisionError" in rosbag2.node.logged[-1]

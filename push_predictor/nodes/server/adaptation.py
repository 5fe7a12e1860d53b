# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The service adapt_model: a loaded model follows the residuals that push_validator publishes.

The windows of a push are taken in together, once a residual of another push arrives or none has for QUIET seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import RLock
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from msg_adapters.diagnostics import diagnostic_status, level_of
from msg_adapters.residuals import residuals_to_table
from push_predictor.adaptation.adaptation import Adaptation, adapted_name
from push_predictor.errors import InactiveError, PushPredictorError, RequestError
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.tabulated.tabulated_model import TabulatedModel
from push_predictor.nodes.runtime import one_line
from push_predictor_interfaces.msg import PushResidual

QUIET = 1.0  # s without a residual after which a push is over
COMMANDS = ("start", "stop", "reset", "save")


@dataclass
class _Following:
    """A loaded model that follows. windows: of the push under way, the last of which arrived at a monotonic time."""

    registry: ModelRegistry
    served: TabulatedModel
    name: str
    adaptation: Adaptation
    running: bool = True
    windows: list[PushResidual] = field(default_factory=list)
    arrived: float = 0.0
    refused: str = ""


class AdaptedModels:
    """Makes one loaded model at a time follow, as NAME_adapted in the registry that `registry` returns.

    mechanisms: those that may change, see Adaptation.
    """

    def __init__(self, node: Node, registry: Callable[[], ModelRegistry], mechanisms: Sequence[str]) -> None:
        self._node, self._registry, self._mechanisms = node, registry, mechanisms
        self._known: _Following | None = None
        self._lock = RLock()  # residuals and commands arrive in two threads
        group = MutuallyExclusiveCallbackGroup()
        node.create_subscription(PushResidual, "push_residual", self.take, 1000, callback_group=group)
        node.create_timer(0.5 * QUIET, self._end_quiet_push, group, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def handle(self, registry: ModelRegistry, request: Any, response: Any) -> None:
        """Fill the response to AdaptModel. Raises PushPredictorError."""
        if request.command not in COMMANDS:
            raise RequestError("command", request.command, f"one of {', '.join(COMMANDS)}")
        with self._lock:
            if request.command == "start":
                self.start(request.model)
            if (known := self._following) is None:
                raise InactiveError("no model follows: start comes first")
            self._end_push(known)
            if request.command == "reset":
                self._begin(known.name, known.running)
            elif request.command == "save":
                _save(known.adaptation, request.path)
            elif request.command == "stop":
                known.running = False
            found = (self._following or known).adaptation
            response.success, response.name, response.message = True, found.adapted.name, str(found)

    def start(self, name: str) -> None:
        """Follow from a loaded model (empty: the default one); goes on where the same one was stopped.

        Raises PushPredictorError.
        """
        with self._lock:
            registry, known = self._registry(), self._following
            name = name or registry.default
            model = registry.get(name).model
            if known is not None and known.name == name and known.adaptation.deployed is model:
                known.running = True
                return
            if (own := adapted_name(name)) in registry.names and (known is None or known.name != name):
                raise RequestError("model", name, f"one beside which no {own} is loaded")
            self._begin(name)

    def take(self, message: PushResidual) -> None:
        """Take in the residual of a window; those of other models are left out."""
        with self._lock:
            known = self._following
            if known is None or not known.running or message.model != known.name:
                return
            if known.windows and known.windows[-1].push_id != message.push_id:
                self._end_push(known)
            known.windows.append(message)
            known.arrived = monotonic()

    def status(self) -> DiagnosticStatus | None:
        """The diagnostics of what follows, None if nothing does."""
        with self._lock:
            if (known := self._following) is None:
                return None
            found = known.adaptation
            values = {
                "model": known.name,
                "adapted": found.adapted.name,
                "follows": known.running,
                "pushes": found.pushes,
                "refused": known.refused or None,
                "noise": found.noise.tolist(),
                **{parameter.name: str(parameter) for parameter in found.parameters},
            }
            level, node = level_of(False, found.out_of_range or known.refused), self._node.get_fully_qualified_name()
            return diagnostic_status(node, "adaptation", level, str(found), values, known.name)

    @property
    def _following(self) -> _Following | None:
        """What follows, unless its models were unloaded since."""
        return self._known if self._known is not None and self._known.registry is self._registry() else None

    def _begin(self, name: str, running: bool = True) -> None:
        registry = self._registry()
        served = registry.get(name)
        adaptation = Adaptation(served.model, self._mechanisms, predict=served.predict_rows)
        self._known = _Following(registry, served, name, adaptation, running)
        _publish(self._known)

    def _end_quiet_push(self) -> None:
        with self._lock:
            known = self._following
            if known is not None and known.windows and monotonic() - known.arrived > QUIET:
                self._end_push(known)

    def _end_push(self, known: _Following) -> None:
        """Take in the push under way. One that cannot be used is reported, and changes nothing."""
        windows, known.windows = known.windows, []
        if not windows:
            return
        try:
            known.adaptation.update(known.adaptation.deployed.continued(residuals_to_table(windows)))
            known.refused = ""
        except PushPredictorError as error:
            known.refused = f"{windows[0].push_id}: {one_line(error)}"
            self._node.get_logger().warning(known.refused, throttle_duration_sec=1.0)
        _publish(known)


def _publish(known: _Following) -> None:
    """Put the adapted model into the registry, with the table of what the deployed one has learnt."""
    served = known.registry.get(known.name)
    if served.model is known.adaptation.deployed:  # it has its table by now
        known.served = served
    model = known.adaptation.adapted
    known.registry.put(model.name, replace(known.served, model=model), known.registry.file(known.name))


def _save(adaptation: Adaptation, path: str) -> None:
    if not path:
        raise RequestError("path", path, "the path of a model file to write, on the server's machine")
    try:
        adaptation.adapted.save(Path(path).expanduser())
    except OSError as error:
        raise RequestError("path", path, f"a file that can be written ({error.strerror})") from None

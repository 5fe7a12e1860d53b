# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Clients of one predict_server that share a process; load.py starts several of these.

Each client is a node that sends a single push or a batch, one request at a time, at a given rate. Its requests never
change, so its responses must not either. `--deaf` sends requests and, once the server has found it, reads no response;
`--stopped` stops itself, as by Ctrl-Z, with responses in transit. Writes the fate of every request as JSON.

The middleware delivers every response of a service to all its clients, and each client must take those of the others to
drop them. Fifty clients therefore take fifty times their own responses. rclpy's executor is too slow for that on two
cores, so a wait set takes them here, as ThreadedService takes requests.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter, sleep
from typing import Any

import numpy as np
import rclpy
from rclpy.client import Client
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.utilities import get_default_context

from benchmarks.support.scripts import parser_of
from push_predictor_interfaces.srv import PredictPush, PredictPushBatch

TIMEOUT = 5.0  # s, after which a client counts a request as failed
PATIENCE = 60.0  # s, for the server to appear and to respond once
BATCH, EVERY = 100, 10  # pushes in a batch; every tenth request is a batch
SINGLE, MANY = "predict_push", "predict_push_batch"
DURATION = 0.2
DEPTH = 1000  # responses that can wait for a client, those to other clients included


@dataclass
class Account:
    """The fate of requests: response times (s), and counts of failures."""

    asked: int = 0
    refused: int = 0
    timed_out: int = 0
    wrong: int = 0
    seconds: list[float] = field(default_factory=list)


class Asker:
    """One client. Call `begin`, then `step` often, and `take` when one of its `clients` is ready."""

    def __init__(self, number: int, rate: float) -> None:
        self.node = Node(f"client_{os.getpid()}_{number}", enable_rosout=False, start_parameter_services=False)
        rng = np.random.default_rng(number)
        self.clients = [self._client(PredictPush, SINGLE), self._client(PredictPushBatch, MANY)]
        self._requests = [_single(rng), _batch(rng)]
        self._first: list[Any] = [None, None]  # answers
        self._pause, self._lag, self._due = 1.0 / rate, rng.random() / rate, 0.0
        self._open: tuple[int, float, int] | None = None  # kind, when it was asked, its number
        self._count = number
        self.accounts = [Account(), Account()]
        self.answered = False  # whether the server has responded to it

    def greet(self) -> None:
        """Send a request that is not counted, from the last client."""
        self.clients[-1].handle.send_request(self._requests[-1])

    def begin(self) -> None:
        """Start asking, each asker at its own moment."""
        self._due = perf_counter() + self._lag

    @property
    def busy(self) -> bool:
        """Whether a request is open."""
        return self._open is not None

    @property
    def due(self) -> float:
        """Time of the next step, by perf_counter."""
        return self._due if self._open is None else self._open[1] + TIMEOUT

    def step(self, asking: bool) -> None:
        """Give up the open request after its timeout; send the next one if it is due and `asking`."""
        now = perf_counter()
        if self._open is not None and now - self._open[1] > TIMEOUT:
            self.accounts[self._open[0]].timed_out += 1
            self._open = None
        if asking and self._open is None and now >= self._due:
            self.ask()
            self._due = max(now, self._due + self._pause)

    def ask(self) -> None:
        """Send the next request."""
        self._count += 1
        kind = int(self._count % EVERY == 0)
        self.accounts[kind].asked += 1
        begun = perf_counter()
        self._open = (kind, begun, self.clients[kind].handle.send_request(self._requests[kind]))

    def take(self, kind: int) -> None:
        """Take a response; it may belong to another client, or to a request that was given up."""
        client = self.clients[kind]
        header, answer = client.handle.take_response(client.srv_type.Response)
        self.answered |= header is not None
        if header is None or self._open is None or header.request_id.sequence_number != self._open[2]:
            return
        account = self.accounts[kind]
        account.seconds.append(perf_counter() - self._open[1])
        self._open = None
        if not answer.success:
            account.refused += 1
        elif self._first[kind] is None:
            self._first[kind] = answer
        elif answer != self._first[kind]:
            account.wrong += 1

    def _client(self, kind: Any, name: str) -> Client:
        client = self.node.create_client(kind, name, qos_profile=QoSProfile(depth=DEPTH))
        if not client.wait_for_service(PATIENCE):
            raise SystemExit(f"{client.srv_name}: the service did not appear within {PATIENCE:g} s")
        return client


class Waiter:
    """Waits for responses to any of the clients."""

    def __init__(self, askers: list[Asker]) -> None:
        self._owner = {c.handle.pointer: (asker, kind) for asker in askers for kind, c in enumerate(asker.clients)}
        self._handles = [client.handle for asker in askers for client in asker.clients]
        context = get_default_context().handle
        self._set = rclpy_implementation.WaitSet(0, 0, 0, len(self._handles), 0, 0, context)

    def wait(self, seconds: float) -> None:
        """Wait at most so long and hand each response to its asker."""
        self._set.clear_entities()
        for handle in self._handles:
            self._set.add_client(handle)
        self._set.wait(round(max(0.0, seconds) * 1e9))
        for pointer in self._set.get_ready_entities("client"):
            asker, kind = self._owner[pointer]
            asker.take(kind)


def main() -> int:
    """Send requests for so many seconds, then wait for the last responses."""
    options = _options()
    rclpy.init()
    askers = [Asker(options.seed * 1000 + k, options.rate) for k in range(options.clients)]
    _acquaint(askers[-1])
    print("asking", flush=True)
    if options.deaf or options.stopped:
        return _never_take(askers[0], options)
    waiter, end = Waiter(askers), perf_counter() + options.seconds
    for asker in askers:
        asker.begin()
    while (asking := perf_counter() < end) or any(asker.busy for asker in askers):
        for asker in askers:
            asker.step(asking)
        waiter.wait(min(asker.due for asker in askers) - perf_counter())
    accounts = [dict(zip((SINGLE, MANY), map(vars, asker.accounts), strict=True)) for asker in askers]
    options.out.write_text(json.dumps(accounts))
    return 0


def _acquaint(last: Asker) -> None:
    """Wait until the server has found all clients of this process; it drops responses to unknown ones.

    It finds them in the order of their creation, so a response to the last one is enough.
    """
    waiter, begun = Waiter([last]), perf_counter()
    while not last.answered:
        if (now := perf_counter()) > begun + PATIENCE:
            raise SystemExit(f"the server did not respond within {PATIENCE:g} s")
        last.greet()
        while not last.answered and (left := now + 1.0 - perf_counter()) > 0.0:
            waiter.wait(left)


def _never_take(asker: Asker, options: argparse.Namespace) -> int:
    """Send requests and never read; `--stopped` sends a hundred at once."""
    begun = perf_counter()
    while perf_counter() - begun < options.seconds:
        asker.ask()
        if not options.stopped:
            sleep(1.0 / options.rate)
        elif asker.accounts[0].asked >= 100:
            os.kill(os.getpid(), signal.SIGSTOP)
    return 0


def _single(rng: np.random.Generator) -> PredictPush.Request:
    velocity, contact, angle = rng.uniform([0.01, 0.0, -1.0], [0.05, 1.0, 1.0]).tolist()
    return PredictPush.Request(velocity=velocity, contact=contact, angle=angle, duration=DURATION)


def _batch(rng: np.random.Generator) -> PredictPushBatch.Request:
    velocity, contact, angle = rng.uniform([0.01, 0.0, -1.0], [0.05, 1.0, 1.0], (BATCH, 3)).T.tolist()
    return PredictPushBatch.Request(velocity=velocity, contact=contact, angle=angle, duration=DURATION)


def _options() -> argparse.Namespace:
    parser = parser_of(__doc__)
    parser.add_argument("--clients", type=int, default=1)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--rate", type=float, required=True, help="requests a second of each client, at most")
    parser.add_argument("--seed", type=int, default=0, help="of the requests")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--deaf", action="store_true")
    parser.add_argument("--stopped", action="store_true")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())

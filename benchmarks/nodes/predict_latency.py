# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Round trip of predict_push between two processes, relative to an empty service in the same run.

    python -m benchmarks.nodes.predict_latency [--pin] [--model FILE] [--calls N] [--domain D]

Without --model these kinds of push are compared, each with its own server: of VHGPs of 100 and of 1000 simulated
windows (trained first, some 20 s), of the latter outside its domain, of an analytical model, and of that model with an
effect: between its training pushes, later than these, and outside the table of the effect. All servers run at the same
time and are called in turns, in short blocks, so that they share the machine's load, which is printed.

Two empty services: `empty` is a plain rclpy node with a std_srvs/Trigger. `empty, direct` is answered by a separate
thread, as predict_push is: the rest of predict_push is the prediction and its larger messages.

Whether client and server share a core changes every time by a factor of two, and the scheduler changes its choice. With
--pin the client runs on one core and the servers on another.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time, sleep
from typing import Any

import numpy as np
from rclpy.client import Client
from rclpy.node import Node
from std_srvs.srv import Trigger

from benchmarks.models.extended_latency import EFFECTS
from benchmarks.models.made_up_models import analytical_model, extended_model, made_up_table
from benchmarks.nodes.server_under_test import (
    DEPTH,
    Caller,
    caller,
    graph,
    load,
    outside_requests,
    predict_server,
    process,
    single_requests,
    trained_vhgp,
)
from msg_adapters.predictions import push_from_request
from push_predictor.models.push_model import PushModel
from push_predictor.models.request import PushRequest
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.store.table_cache import as_served, keep_tables
from push_predictor.models.tabulated.tabulated_model import TabulatedModel
from push_predictor.nodes.runtime import Stop, run
from push_predictor.nodes.server.threaded_service import ThreadedService
from push_predictor_interfaces.srv import PredictPush

BLOCK = 20
WARM_UP = 200
SIZES = (100, 1000)  # windows
REQUESTS = 200  # different ones of each kind
EFFECT = "friction, linear"  # of EFFECTS
LATER, FAR = 1900.0, 5000.0  # s; the training pushes take 1000, and the table of the effect contains up to twice that
SETTLING = 15.0  # s, until the servers have computed all that makes predictions fast
ROUNDS = 5


class EmptyServer(Node):
    """Answers std_srvs/Trigger and does nothing else: the minimum of a round trip."""

    def __init__(self, stop: Stop) -> None:
        super().__init__("empty_server")
        self.create_service(Trigger, "empty", lambda request, response: response, qos_profile=DEPTH)

    def close(self) -> None:
        """Do nothing: rclpy destroys the service."""


class DirectEmptyServer(Node):
    """The same, answered as predict_server answers predict_push."""

    def __init__(self, stop: Stop) -> None:
        super().__init__("direct_empty_server")
        self._service = ThreadedService(self, Trigger, "direct", lambda request, response: response, DEPTH)
        self._service.start()

    def close(self) -> None:
        """End the thread."""
        self._service.close()


SERVERS: dict[str, Callable[[Stop], EmptyServer | DirectEmptyServer]] = {
    "empty": EmptyServer,
    "direct": DirectEmptyServer,
}


def main() -> int:
    """Measure, or run as one of the empty servers."""
    arguments = _arguments()
    if arguments.serve:
        return run(f"{arguments.serve}_server", SERVERS[arguments.serve], ["--ros-args"])
    with ExitStack() as stack:
        cases = [_of_file(arguments.model)] if arguments.model else _cases(Path(stack.enter_context(_folder())))
        cores = os.sched_getaffinity(0)
        if arguments.pin:
            os.sched_setaffinity(0, {max(cores)})
        stack.enter_context(graph(arguments.domain))
        numbers = [
            stack.enter_context(process("-m", "benchmarks.nodes.predict_latency", "--serve", name)) for name in SERVERS
        ]
        numbers += [stack.enter_context(predict_server(case.path, f"/server_{k}")) for k, case in enumerate(cases)]
        if arguments.pin:  # at once: threads inherit it
            for number in numbers:
                os.sched_setaffinity(number, {min(cores)})
        _measure(stack.enter_context(caller()), cases, arguments.calls)
    return 0


@dataclass(frozen=True, eq=False)
class Case:
    """A kind of push: its name, the model and its file, and requests."""

    name: str
    path: Path
    model: PushModel
    requests: list[PredictPush.Request]


def _of_file(path: Path) -> Case:
    model = load_model(path)
    return Case(f"{model.name}, n = {len(model.training)}", path, model, single_requests(model, REQUESTS))


def _folder() -> TemporaryDirectory[str]:
    return TemporaryDirectory(prefix="push_model_")


def _cases(folder: Path) -> list[Case]:
    small, large = (trained_vhgp(size) for size in SIZES)
    analytical = analytical_model(made_up_table(300, 0))
    extended = extended_model(analytical, *EFFECTS[EFFECT])
    kinds = {
        f"VHGP, n = {SIZES[0]}": (small, single_requests(small, REQUESTS)),
        f"VHGP, n = {SIZES[1]}": (large, single_requests(large, REQUESTS)),
        f"VHGP, n = {SIZES[1]}, outside": (large, outside_requests(large, REQUESTS)),
        "analytical": (analytical, single_requests(analytical, REQUESTS)),
        "with an effect": (extended, single_requests(extended, REQUESTS)),
        "effect, later": (extended, _at(LATER, single_requests(extended, REQUESTS))),
        "effect, outside its table": (extended, _at(FAR, single_requests(extended, REQUESTS))),
    }
    found = []
    for k, (name, (model, requests)) in enumerate(kinds.items()):
        path = folder / f"{k}.pushmodel"
        save_model(model, path)
        keep_tables(model, path)
        found.append(Case(name, path, model, requests))
    return found


def _at(time: float, requests: list[PredictPush.Request]) -> list[PredictPush.Request]:
    """The same pushes at a time, s."""
    for request in requests:
        request.covariate_values = [time]
    return requests


def _measure(client: Caller, cases: list[Case], calls: int) -> None:
    count = calls + WARM_UP
    asked: dict[str, tuple[Client, list[Any]]] = {
        "empty": (client.client(Trigger, "empty"), [Trigger.Request()]),
        "empty, direct": (client.client(Trigger, "direct"), [Trigger.Request()]),
    }
    for k, case in enumerate(cases):
        asked[case.name] = (client.client(PredictPush, f"/server_{k}/predict_push"), case.requests)
    sleep(SETTLING)
    taken: dict[str, list[float]] = {name: [] for name in asked}
    before = load()
    for start in range(0, count, BLOCK):
        for name, (service, requests) in asked.items():
            block = (requests[k % len(requests)] for k in range(start, start + BLOCK))
            taken[name] += [client.timed(service, request)[0] for request in block]
    print(f"{calls} calls of each service, one at a time; load average {before} before, {load()} after")
    _report({name: np.array(values[WARM_UP:]) * 1e6 for name, values in taken.items()})
    for k, case in enumerate(cases):
        status = client.reported(f"/server_{k}/")
        times = f"p50 {status['callback_p50_us']} us, p99 {status['callback_p99_us']} us"
        print(f"callback in the server, {case.name:28s} {times}")
    for case in cases:
        _in_this_process(case)


def _report(times: dict[str, np.ndarray]) -> None:
    rows = {name: np.percentile(values, [50, 95, 99]) for name, values in times.items()}
    print(f"{'round trip, us':28s}{'p50':>9s}{'p95':>9s}{'p99':>9s}   p50 / empty's   / direct's")
    for name, row in rows.items():
        ratios = [row[0] / rows[floor][0] for floor in ("empty", "empty, direct")]
        print(f"{name:28s}" + "".join(f"{value:9.0f}" for value in row) + f"{ratios[0]:16.2f}{ratios[1]:13.2f}")


def _in_this_process(case: Case) -> None:
    """Print processor time of predictions without ROS: the time of a busy machine goes to others."""
    tabulated = as_served(case.model)
    pushes = [push_from_request(request) for request in case.requests]
    table, exact = (_processor_time(model, pushes) for model in (tabulated, case.model))
    print(f"{case.name}: {tabulated.how}")
    print(f"  in this process, processor time: as served {table:.0f} us, exact model {exact:.0f} us")


def _processor_time(model: PushModel | TabulatedModel, pushes: list[PushRequest]) -> float:
    """Of one prediction, us: the least of some rounds over all pushes."""
    arrays = [push.arrays for push in pushes]
    rounds = []
    for _ in range(ROUNDS):
        start = process_time()
        for inputs, duration, covariates in arrays:
            model.predict_rows(inputs, duration, covariates)
        rounds.append((process_time() - start) / len(arrays))
    return min(rounds) * 1e6


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path, help="a model file (default: the kinds above)")
    parser.add_argument("--calls", type=int, default=2000, help="calls of each service (default 2000)")
    parser.add_argument("--domain", type=int, default=77, help="ROS domain to run in (default 77)")
    parser.add_argument("--pin", action="store_true", help="client on one core, servers on another")
    parser.add_argument("--serve", choices=SERVERS, help=argparse.SUPPRESS)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())

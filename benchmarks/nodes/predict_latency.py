# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Round trip of predict_push between two processes, relative to an empty service in the same run.

    python -m benchmarks.nodes.predict_latency [--pin] [--model FILE] [--calls N] [--domain D]

Without --model these kinds of push are compared, each with its own server: of VHGPs of 100 and of 1000 simulated
windows (trained first, some 20 s), of the latter outside its domain, of an analytical model, of that model with an
effect (between its training pushes, later than these, and far outside their range) and with two, of fitted mechanics,
of a VHGP about these, and of the prior before the first push. All servers run at the same time and are called in turns,
in short blocks, so that they share the machine's load, which is printed.

The last table has the callback's median in the server, its ratio to that of the tabulated VHGP, and times of one
prediction in this process: processor time with the model as tabulated, and of PushModel.predict of the library.

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

from benchmarks.models.made_up_models import (
    analytical_model,
    drifting_effect,
    extended_model,
    fitted_model,
    informed_model,
    made_up_table,
    prior_model,
    trained_vhgp,
)
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
)
from benchmarks.support.scripts import parser_of, ruled
from msg_adapters.predictions import push_from_request
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Pushes
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
TABULATED = f"VHGP, n = {SIZES[-1]}"  # the row that the others are compared with
LATER, FAR = 1900.0, 5000.0  # s; the training pushes take 1000
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
    table = made_up_table(300, 0)
    analytical = analytical_model(table)
    friction, centre = drifting_effect("contact_friction", 0.1), drifting_effect("centre_of_friction", 0.002, -0.002)
    extended, twice = extended_model(analytical, friction), extended_model(analytical, friction, centre)
    others = {
        "fitted mechanics": fitted_model(table),
        "informed VHGP": informed_model(table, "vhgp"),
    }
    kinds = {
        f"VHGP, n = {SIZES[0]}": (small, single_requests(small, REQUESTS)),
        TABULATED: (large, single_requests(large, REQUESTS)),
        f"{TABULATED}, outside": (large, outside_requests(large, REQUESTS)),
        "analytical": (analytical, single_requests(analytical, REQUESTS)),
        "with an effect": (extended, single_requests(extended, REQUESTS)),
        "effect, later": (extended, _at(LATER, single_requests(extended, REQUESTS))),
        "effect, outside its range": (extended, _at(FAR, single_requests(extended, REQUESTS))),
        "two effects": (twice, single_requests(twice, REQUESTS)),
        **{name: (model, single_requests(model, REQUESTS)) for name, model in others.items()},
        "prior": (prior_model(), single_requests(analytical, REQUESTS)),
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
    _report_callbacks(cases, [client.reported(f"/server_{k}/") for k in range(len(cases))])


def _report(times: dict[str, np.ndarray]) -> None:
    rows = {name: np.percentile(values, [50, 95, 99]) for name, values in times.items()}
    print(f"{'round trip, us':28s}{'p50':>9s}{'p95':>9s}{'p99':>9s}   p50 / empty's   / direct's")
    for name, row in rows.items():
        ratios = [row[0] / rows[floor][0] for floor in ("empty", "empty, direct")]
        print(f"{name:28s}" + "".join(f"{value:9.0f}" for value in row) + f"{ratios[0]:16.2f}{ratios[1]:13.2f}")


def _report_callbacks(cases: list[Case], statuses: list[dict[str, str]]) -> None:
    """Print a table; processor time, because the time of a busy machine goes to others."""
    medians = {case.name: float(status["callback_p50_us"]) for case, status in zip(cases, statuses, strict=True)}
    head = "| kind | callback, us | 99 % | callback / tabulated | processor time, us | library, us | predicts |"
    print("\n" + ruled(head))
    for case, status in zip(cases, statuses, strict=True):
        tabulated = as_served(case.model)
        ratio = f"{medians[case.name] / medians[TABULATED]:.2f}" if TABULATED in medians else ""
        table, library = _processor_times(tabulated, case)
        times = f"{medians[case.name]:.0f} | {status['callback_p99_us']} | {ratio} | {table:.0f} | {library:.0f}"
        print(f"| {case.name} | {times} | {tabulated.how} |")


def _processor_times(tabulated: TabulatedModel, case: Case) -> tuple[float, float]:
    """Of one prediction with and without tables, us: the least of some rounds over all pushes, in turns."""
    arrays = [push_from_request(request).arrays for request in case.requests]
    pushes = [Pushes(v, c, a, duration, covariates) for ((v, c, a),), duration, covariates in arrays]
    rounds = []
    for _ in range(ROUNDS):
        start = process_time()
        for inputs, duration, covariates in arrays:
            tabulated.predict_rows(inputs, duration, covariates)
        middle = process_time()
        for push in pushes:
            case.model.predict(push)
        rounds.append([middle - start, process_time() - middle])
    table, library = (float(value) * 1e6 / len(arrays) for value in np.min(rounds, axis=0))
    return table, library


def _arguments() -> argparse.Namespace:
    parser = parser_of(__doc__)
    parser.add_argument("--model", type=Path, help="a model file (default: the kinds above)")
    parser.add_argument("--calls", type=int, default=2000, help="calls of each service (default 2000)")
    parser.add_argument("--domain", type=int, default=77, help="ROS domain to run in (default 77)")
    parser.add_argument("--pin", action="store_true", help="client on one core, servers on another")
    parser.add_argument("--serve", choices=SERVERS, help=argparse.SUPPRESS)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())

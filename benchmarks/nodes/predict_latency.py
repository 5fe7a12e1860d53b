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

Without --model two VHGPs are trained first, of 100 and of 1000 simulated windows (some 20 s), each for its own server:
both should take equally long. All servers run at the same time and are called in turns, in short blocks, so that they
share the machine's load, which is printed.

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
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from rclpy.client import Client
from rclpy.node import Node
from std_srvs.srv import Trigger

from benchmarks.nodes.server_under_test import (
    DEPTH,
    Caller,
    caller,
    graph,
    load,
    model_files,
    predict_server,
    process,
    single_requests,
)
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.models.tabulated.tabulated_model import TabulatedModel, tabulate
from push_predictor.nodes.runtime import Stop, run
from push_predictor.nodes.server.threaded_service import ThreadedService
from push_predictor_interfaces.srv import PredictPush

BLOCK = 20
WARM_UP = 200
SIZES = (100, 1000)  # windows


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
        paths = [arguments.model] if arguments.model else stack.enter_context(model_files(*SIZES))
        models = [load_model(path) for path in paths]
        cores = os.sched_getaffinity(0)
        if arguments.pin:
            os.sched_setaffinity(0, {max(cores)})
        stack.enter_context(graph(arguments.domain))
        numbers = [
            stack.enter_context(process("-m", "benchmarks.nodes.predict_latency", "--serve", name)) for name in SERVERS
        ]
        numbers += [stack.enter_context(predict_server(path, f"/server_{k}")) for k, path in enumerate(paths)]
        if arguments.pin:  # at once: threads inherit it
            for number in numbers:
                os.sched_setaffinity(number, {min(cores)})
        _measure(stack.enter_context(caller()), models, arguments.calls)
    return 0


def _measure(client: Caller, models: list[PushModel], calls: int) -> None:
    count = calls + WARM_UP
    asked: dict[str, tuple[Client, list[Any]]] = {
        "empty": (client.client(Trigger, "empty"), [Trigger.Request()] * count),
        "empty, direct": (client.client(Trigger, "direct"), [Trigger.Request()] * count),
    }
    for k, model in enumerate(models):
        asked[f"predict_push, n = {len(model.training)}"] = (
            client.client(PredictPush, f"/server_{k}/predict_push"),
            single_requests(model, count),
        )
    taken: dict[str, list[float]] = {name: [] for name in asked}
    before = load()
    for start in range(0, count, BLOCK):
        for name, (service, requests) in asked.items():
            taken[name] += [client.timed(service, request)[0] for request in requests[start : start + BLOCK]]
    print(f"{calls} calls of each service, one at a time; load average {before} before, {load()} after")
    _report({name: np.array(values[WARM_UP:]) * 1e6 for name, values in taken.items()})
    for k, model in enumerate(models):
        status = client.reported(f"/server_{k}/")
        times = f"p50 {status['callback_p50_us']} us, p99 {status['callback_p99_us']} us"
        print(f"callback in the server, n = {len(model.training)}: {times}")
    for model in models:
        _in_this_process(model)


def _report(times: dict[str, np.ndarray]) -> None:
    rows = {name: np.percentile(values, [50, 95, 99]) for name, values in times.items()}
    print(f"{'round trip, us':24s}{'p50':>9s}{'p95':>9s}{'p99':>9s}   p50 / empty's   / direct's")
    for name, row in rows.items():
        ratios = [row[0] / rows[floor][0] for floor in ("empty", "empty, direct")]
        print(f"{name:24s}" + "".join(f"{value:9.0f}" for value in row) + f"{ratios[0]:16.2f}{ratios[1]:13.2f}")


def _in_this_process(model: PushModel) -> None:
    start = perf_counter()
    tabulated = tabulate(model)
    made = perf_counter() - start
    print(f"{model.name}, {len(model.training)} windows, {tabulated.how}; made in {made:.2f} s")
    print(
        f"  in this process, p50: tabulated model {_model_time(tabulated):.0f} us, exact model "
        f"{_model_time(model):.0f} us"
    )


def _model_time(model: PushModel | TabulatedModel) -> float:
    training = model.model.training if isinstance(model, TabulatedModel) else model.training
    inputs, duration = training.inputs[:200], training.duration[:200]
    times = []
    for k in range(len(inputs)):
        start = perf_counter()
        model.predict_rows(inputs[k : k + 1], duration[k : k + 1])
        times.append(perf_counter() - start)
    return float(np.median(times)) * 1e6


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path, help="a model file (default: train two)")
    parser.add_argument("--calls", type=int, default=2000, help="calls of each service (default 2000)")
    parser.add_argument("--domain", type=int, default=77, help="ROS domain to run in (default 77)")
    parser.add_argument("--pin", action="store_true", help="client on one core, servers on another")
    parser.add_argument("--serve", choices=SERVERS, help=argparse.SUPPRESS)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())

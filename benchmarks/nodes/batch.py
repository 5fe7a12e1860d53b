# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Predictions per second of predict_push_batch between two processes, relative to single calls in the same run.

    python -m benchmarks.nodes.batch [--model FILE] [--sizes N ...] [--seconds S] [--domain D]

Without --model a VHGP of 1000 simulated windows is trained first (some 10 s), and an analytical model is measured after
it. A call is timed from arrays of pushes to
arrays of predictions: request, transport, prediction, response, unpacking. Single calls run between the batches. Last:
how long single calls take while the server computes the longest batch.
"""

from __future__ import annotations

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, sleep

import numpy as np
from rclpy.client import Client

from benchmarks.models.made_up_models import analytical_model, made_up_table, trained_vhgp
from benchmarks.nodes.server_under_test import Caller, caller, graph, load, predict_server, single_requests
from benchmarks.nodes.vitals import memory_of
from benchmarks.support.scripts import parser_of
from msg_adapters.predictions import PushQuery, prediction_from_response, query_to_batch_request
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.nodes.server.services import MAX_EXACT
from push_predictor_interfaces.srv import PredictPush, PredictPushBatch

SIZES = (1, 10, 100, 1000, 5000, 20_000, 100_000, 1_000_000)
SINGLES = 200  # calls between two sizes
WARM_UP = 200


def main() -> int:
    """Measure and print."""
    arguments = _arguments()
    with ExitStack() as stack:
        paths = [arguments.model]
        if not arguments.model:
            folder = Path(stack.enter_context(TemporaryDirectory(prefix="push_model_")))
            models = (trained_vhgp(1000), analytical_model(made_up_table(300, 0)))
            paths = [folder / f"{model.name}.pushmodel" for model in models]
            for model, path in zip(models, paths, strict=True):
                save_model(model, path)
        stack.enter_context(graph(arguments.domain))
        for path in paths:
            _measure_model(path, arguments.sizes, arguments.seconds)
    return 0


def _measure_model(path: Path, sizes: list[int], seconds: float) -> None:
    model = load_model(path)
    with predict_server(path) as server, caller() as client:
        print(f"{model.name}: {model.kind}, {len(model.training)} windows; load average {load()} before")
        learnt = model.predictor.learnt
        _measure(client, model, [size for size in sizes if learnt or size <= MAX_EXACT], seconds, server)
        print(f"load average {load()} after")


def _measure(client: Caller, model: PushModel, sizes: list[int], seconds: float, server: int) -> None:
    single, batch = client.client(PredictPush, "predict_push"), client.client(PredictPushBatch, "predict_push_batch")
    requests = single_requests(model, SINGLES)
    for _ in range(WARM_UP // len(requests) + 1):
        _single_times(client, single, requests)
    alone: list[float] = []
    medians = {}
    memory = {}
    for size in sizes:
        alone += _single_times(client, single, requests)
        medians[size] = _batch_time(client, batch, model, size, seconds)
        memory[size] = memory_of(server, "VmHWM")
    rate = 1.0 / float(np.median(alone))
    print(f"single calls, one at a time: {rate:.0f} predictions/s (p50 of {len(alone)})")
    print(f"{'n a call':>10s}{'ms a call':>12s}{'predictions/s':>16s}{'/ single':>10s}{'server peak MB':>16s}")
    for size, median in medians.items():
        each = size / median
        print(f"{size:10d}{median * 1e3:12.2f}{each:16.0f}{each / rate:10.1f}{memory[size]:16.0f}")
    _during_a_batch(client, single, batch, model, max(sizes))


def _single_times(client: Caller, single: Client, requests: list[PredictPush.Request]) -> list[float]:
    return [client.timed(single, request)[0] for request in requests]


def _batch_time(client: Caller, batch: Client, model: PushModel, size: int, seconds: float) -> float:
    """Median time of the calls that fit into so many seconds, three at least."""
    times: list[float] = []
    query = _query(model, size)
    end = perf_counter() + seconds
    while len(times) < 3 or perf_counter() < end:
        start = perf_counter()
        _, response = client.timed(batch, query_to_batch_request(query))
        prediction = prediction_from_response(response)
        times.append(perf_counter() - start)
        if prediction.covariance.shape != (size, 3, 3):
            raise SystemExit(f"{size} pushes requested, {len(prediction.mean)} predicted")
    return float(np.median(times))


def _during_a_batch(client: Caller, single: Client, batch: Client, model: PushModel, size: int) -> None:
    request, push = query_to_batch_request(_query(model, size)), single_requests(model, 1)[0]
    start = perf_counter()
    answer = batch.call_async(request)
    times: list[float] = []
    while True:
        elapsed, _ = client.timed(single, push)
        if answer.done():  # the client has unpacked the batch meanwhile, which is not the server's time
            break
        times.append(elapsed)
        sleep(0.005)
    print(f"during a batch of {size} ({perf_counter() - start:.2f} s): {len(times)} single calls, ", end="")
    p50, p99 = np.percentile(times, [50, 99]) * 1e3 if times else (np.nan, np.nan)
    print(f"p50 {p50:.1f} ms, p99 {p99:.1f} ms, longest {max(times, default=np.nan) * 1e3:.1f} ms")


def _query(model: PushModel, size: int) -> PushQuery:
    rows = np.random.default_rng(1).integers(0, len(model.training), size)
    return PushQuery("", model.training.inputs[rows], float(model.training.duration[0]), {})


def _arguments() -> argparse.Namespace:
    parser = parser_of(__doc__)
    parser.add_argument("--model", type=Path, help="a model file (default: train one)")
    parser.add_argument("--sizes", type=int, nargs="+", default=list(SIZES), help="pushes a call")
    parser.add_argument("--seconds", type=float, default=2.0, help="of calls for each size (default 2)")
    parser.add_argument("--domain", type=int, default=78, help="ROS domain to run in (default 78)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())

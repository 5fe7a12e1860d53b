"""Round trip of predict_push between two processes, beside that of an empty service in the same run.

    python benchmarks/predict_latency.py [--model FILE] [--calls N] [--domain D]

Without --model a VHGP of 1000 simulated windows is trained first (some 10 s). The two servers run at the same time and
are asked in turns, in short blocks, so that both see the same load of the machine; the load is printed beside the
numbers.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import perf_counter, sleep
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.analytical import AnalyticalPush
from push_predictor.models.model_file import load_model, save_model
from push_predictor.models.push_model import PushModel
from push_predictor.models.served import ServedModel, serve
from push_predictor.models.train import train_model
from push_predictor.nodes.runtime import Stop, run
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor_interfaces.srv import PredictPush

BLOCK = 20
WARM_UP = 200
DEPTH = QoSProfile(depth=100)


class EmptyServer(Node):
    """Answers std_srvs/Trigger and does nothing else: the floor of a round trip."""

    def __init__(self, stop: Stop) -> None:
        super().__init__("empty_server")
        self.create_service(Trigger, "empty", lambda request, response: response, qos_profile=DEPTH)

    def close(self) -> None:
        """Nothing is left to do."""


def main() -> int:
    """Measure, or be the empty server that is measured."""
    arguments = _arguments()
    if arguments.serve_empty:
        return run("empty_server", EmptyServer, ["--ros-args"])
    os.environ.update(ROS_DOMAIN_ID=str(arguments.domain), ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST")
    with ExitStack() as stack:
        model = arguments.model or _trained(Path(stack.enter_context(tempfile.TemporaryDirectory())))
        stack.enter_context(_process(__file__, "--serve-empty"))
        stack.enter_context(
            _process("-m", "push_predictor.nodes.predict_server", "--ros-args", "-p", f"models:=['{model}']")
        )
        _measure(model, arguments.calls)
    return 0


def _measure(path: Path, calls: int) -> None:
    rclpy.init()
    node = Node("latency_client")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    callback: dict[str, str] = {}
    node.create_subscription(DiagnosticArray, "/diagnostics", lambda m: callback.update(_values(m)), 10)
    empty = node.create_client(Trigger, "empty", qos_profile=DEPTH)
    predict = node.create_client(PredictPush, "predict_push", qos_profile=DEPTH)
    model = load_model(path)
    requests = _requests(model, calls + WARM_UP)
    times: dict[str, list[float]] = {"empty": [], "predict_push": []}
    try:
        for client in (empty, predict):
            if not client.wait_for_service(30.0):
                raise SystemExit(f"{client.srv_name}: the service did not appear within 30 s")
        load_before = os.getloadavg()[0]
        for start in range(0, len(requests), BLOCK):
            block = requests[start : start + BLOCK]
            times["empty"] += [_seconds(executor, empty, Trigger.Request()) for _ in block]
            times["predict_push"] += [_seconds(executor, predict, request) for request in block]
        _until(executor, lambda: "callback_p50_us" in callback and callback["callback_p50_us"] != "-")
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    print(f"{model.name}: {model.kind}, {len(model.training)} windows; {calls} calls of each service, one at a time")
    print(f"load average {load_before:.1f} before, {os.getloadavg()[0]:.1f} after, {os.cpu_count()} cores")
    _report({name: np.array(values[WARM_UP:]) * 1e6 for name, values in times.items()}, callback)
    start = perf_counter()
    served = serve(model)
    print(f"served: {served.how}; made in {perf_counter() - start:.2f} s")
    print(f"in this process, p50: served model {_model_time(served):.0f} us, the model {_model_time(model):.0f} us")


def _report(times: dict[str, np.ndarray], callback: dict[str, str]) -> None:
    rows = {name: np.percentile(values, [50, 95, 99]) for name, values in times.items()}
    print(f"{'us':24s}{'p50':>9s}{'p95':>9s}{'p99':>9s}")
    for name, row in rows.items():
        print(f"{name + ' round trip':24s}" + "".join(f"{value:9.0f}" for value in row))
    print(f"{'ratio':24s}" + "".join(f"{value:9.2f}" for value in rows["predict_push"] / rows["empty"]))
    print(f"callback in the server: p50 {callback['callback_p50_us']} us, p99 {callback['callback_p99_us']} us")


def _model_time(model: PushModel | ServedModel) -> float:
    training = model.model.training if isinstance(model, ServedModel) else model.training
    inputs, duration = training.inputs[:200], training.duration[:200]
    times = []
    for k in range(len(inputs)):
        start = perf_counter()
        model.predict(inputs[k : k + 1], duration[k : k + 1])
        times.append(perf_counter() - start)
    return float(np.median(times)) * 1e6


def _seconds(executor: SingleThreadedExecutor, client: Client, request: Any) -> float:
    start = perf_counter()
    future = client.call_async(request)
    while not future.done():
        executor.spin_once()  # spin_until_future_complete would leave tasks behind, and slow down
    elapsed = perf_counter() - start
    if isinstance(response := future.result(), PredictPush.Response) and not response.success:
        raise SystemExit(f"predict_push refused: {response.message}")
    return elapsed


def _until(executor: SingleThreadedExecutor, condition: Callable[[], bool], seconds: float = 10.0) -> None:
    end = perf_counter() + seconds
    while not condition():
        if perf_counter() > end:
            raise SystemExit(f"no diagnostics of the server within {seconds:g} s")
        executor.spin_once(timeout_sec=0.1)


def _requests(model: PushModel, count: int) -> list[PredictPush.Request]:
    table = model.training
    rows = np.random.default_rng(0).integers(0, len(table), count)
    return [
        PredictPush.Request(velocity=v, contact=c, angle=a, duration=d)
        for (v, c, a), d in zip(table.inputs[rows].tolist(), table.duration[rows].tolist(), strict=True)
    ]


def _values(message: DiagnosticArray) -> dict[str, str]:
    return {pair.key: pair.value for status in message.status for pair in status.values}


def _trained(folder: Path, count: int = 1000) -> Path:
    rng = np.random.default_rng(0)
    rig = Rig("rect1", shape_outline("rect1"), 0.00475, "abs", 0.837)
    inputs = np.column_stack([np.full(count, 0.02), rng.uniform(0, 1, count), rng.uniform(-1.2, 1.2, count)])
    duration = np.full(count, 0.2)
    outcomes = AnalyticalPush(rig.outline, rig.pusher_radius).displacement(inputs, duration)
    outcomes += rng.normal(size=(count, 3)) * [1e-4, 1e-4, 5e-3] * (0.3 + np.abs(inputs[:, 2:]))
    table = PushTable(inputs, duration, outcomes, np.array([f"p{k // 10}" for k in range(count)]))
    save_model(train_model(table, rig, "vhgp", name="simulated"), folder / "simulated.model")
    return folder / "simulated.model"


@contextmanager
def _process(*arguments: str) -> Iterator[None]:
    environment = {k: v for k, v in os.environ.items() if k != "_ROS_WHEELS_BOOTSTRAP_COMPLETE"}
    environment["OPENBLAS_NUM_THREADS"] = "1"
    root = str(Path(__file__).resolve().parents[1])
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, [root, environment.get("PYTHONPATH")]))
    process = subprocess.Popen([sys.executable, *arguments], env=environment)
    try:
        sleep(0.1)
        yield
    finally:
        process.terminate()
        process.wait(10.0)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path, help="a model file (default: train one)")
    parser.add_argument("--calls", type=int, default=2000, help="calls of each service (default 2000)")
    parser.add_argument("--domain", type=int, default=77, help="ROS domain to run in (default 77)")
    parser.add_argument("--serve-empty", action="store_true", help=argparse.SUPPRESS)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ROS checks of `push_predictor doctor`, in a process of their own: one line of JSON on stdout for each finding.

A finding is {"name", "state", "found", "why", "remedy"}; {"name"} alone announces the check that runs next.
"""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

PACKAGES = (
    "builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "lifecycle_msgs", "rcl_interfaces", "rosgraph_msgs",
    "sensor_msgs", "std_msgs", "std_srvs", "visualization_msgs",
)  # fmt: skip
INTERFACES = {
    "srv.PredictPush.Request": ("velocity", "contact", "angle", "duration", "push_residual"),
    "srv.PredictPush.Response": ("mean", "covariance", "process_covariance", "in_domain"),
    "srv.PredictPushBatch.Response": ("mean", "covariance", "process_covariance", "in_domain"),
    "srv.PredictSliderPose.Response": ("slider_after", "in_domain"),
    "srv.RolloutPushes.Response": ("poses", "samples"),
    "srv.SuggestPushes.Response": ("velocity", "contact", "angle", "duration", "variance_left"),
    "srv.ListModels.Response": ("names", "descriptions", "default_model"),
    "srv.LoadModel.Response": ("success", "name"),
    "msg.PushResidual": ("predicted", "covariance", "observed", "standardised"),
    "msg.PushAlarm": ("push_id", "log10_evidence", "false_alarm_rate"),
    "action.TraceResidual.Result": ("verdict", "extended_model"),
}
INSTALL_ROS = "pip install 'ros-jazzy-rclpy[fastrtps]', or . /opt/ros/jazzy/setup.sh"
BUILD_INTERFACES = "pip install ./push_predictor_interfaces, or colcon build && . install/setup.sh"
PATIENCE = 20.0  # s that predict_server may take to start, and to answer
AGAIN = 4.0  # s after which the request is sent again
PUSH = {"velocity": 0.02, "contact": 0.1, "angle": 0.1, "duration": 0.2}
TRANSPORT_REMEDY = (
    "export FASTDDS_BUILTIN_TRANSPORTS=UDPv4, or another ROS_DOMAIN_ID; a firewall must let UDP on lo pass"
)


def main() -> int:
    """Run the checks in order, without those that need one that failed; returns the exit status."""
    for name, check in (("rclpy", rclpy_works), ("messages", messages), ("interfaces", interfaces)):
        if not _report(name, check):
            return 1
    passed = [_report("middleware", middleware), _report("shared memory", shared_memory), _report("security", security)]
    return 0 if all(passed) and _report("loop-back call", loop_back) else 1


def rclpy_works() -> dict[str, str]:
    """Check that the client library imports, with the middleware below it."""
    try:
        import rclpy
        from rclpy.impl.implementation_singleton import rclpy_implementation
    except Exception as error:  # a library that does not load raises many kinds
        why = "the nodes need it; training, prediction and reports do not"
        return _missing(f"not usable ({error})", why, INSTALL_ROS)
    assert rclpy_implementation
    distribution = os.environ.get("ROS_DISTRO", "")
    return _ok(f"{Path(rclpy.__file__).parent}{distribution and f', ROS {distribution}'}")


def messages() -> dict[str, str]:
    """Check that the standard messages are installed which the nodes use."""
    missing = [package for package in PACKAGES if not _imports(f"{package}.{_kind(package)}")]
    if missing:
        return _missing(f"not found: {', '.join(missing)}", "the nodes publish and subscribe to them", INSTALL_ROS)
    return _ok(f"{len(PACKAGES)} packages")


def interfaces() -> dict[str, str]:
    """Check that push_predictor_interfaces is installed, with the fields that this version fills."""
    try:
        package = importlib.import_module("push_predictor_interfaces")
        lacking = [
            f"{name}.{field}" for name, fields in INTERFACES.items() for field in fields if not _has(name, field)
        ]
    except Exception as error:  # as above
        return _missing(
            f"push_predictor_interfaces is not usable ({error})",
            "the nodes communicate with these interfaces",
            BUILD_INTERFACES,
        )
    if lacking:
        found = f"push_predictor_interfaces has no {', '.join(lacking)}"
        return _missing(found, "its version differs from that of push_predictor", BUILD_INTERFACES)
    return _ok(str(Path(package.__file__ or "").parent))


def middleware() -> dict[str, str]:
    """Report the middleware, the domain and the range of discovery."""
    from rclpy.utilities import get_rmw_implementation_identifier

    from push_predictor.nodes.network_security import DISCOVERY, limit_discovery

    given = ", ".join(f"{name}={os.environ[name]}" for name in DISCOVERY if os.environ.get(name))
    reach = "only on this machine, the default of these nodes" if limit_discovery() else given
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    return _ok(f"{get_rmw_implementation_identifier()}, domain {domain}, discovery: {reach}")


def shared_memory() -> dict[str, str]:
    """Check that /dev/shm is writable: Fast DDS delivers messages on one machine through it."""
    place = Path("/dev/shm")
    if os.access(place, os.W_OK) or "UDP" in os.environ.get("FASTDDS_BUILTIN_TRANSPORTS", ""):
        return _ok(f"{place} is writable" if os.access(place, os.W_OK) else "not used")
    remedy = "export FASTDDS_BUILTIN_TRANSPORTS=UDPv4"
    return _finding("note", f"{place} is not writable", "Fast DDS reports errors or loses messages", remedy)


def security() -> dict[str, str]:
    """Check that the security is available that the environment requests."""
    from push_predictor.nodes.network_security import ENABLE, SecurityError, require_security, security_compiled_in

    try:
        require_security()
    except SecurityError as error:
        return _missing(
            str(error), "the nodes refuse to start", f"unset {ENABLE}, or install a middleware with security"
        )
    if os.environ.get(ENABLE) != "true":
        support = "supports" if security_compiled_in() else "was built without"
        return _ok(f"not requested; the middleware {support} it")
    if os.environ.get("ROS_SECURITY_STRATEGY") != "Enforce":
        why = "a node without keys starts unprotected, without a warning"
        return _finding("note", "requested, not enforced", why, "export ROS_SECURITY_STRATEGY=Enforce")
    return _ok("requested and enforced")


def loop_back() -> dict[str, str]:
    """Check that a predict_server with the shipped model starts and answers, in a namespace of its own."""
    namespace = f"/push_predictor_doctor_{os.getpid()}"
    command = [sys.executable, "-m", "push_predictor.nodes.predict_server", "--ros-args", "-r", f"__ns:={namespace}"]
    with tempfile.TemporaryFile("w+") as log:
        server = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)
        try:
            begun = time.monotonic()
            problem = _call(namespace, lambda: server.poll() is None)
            took = time.monotonic() - begun
        finally:
            server.kill()
            server.wait()
        if not problem:
            return _ok(f"predict_push answered {took:.1f} s after the start of predict_server")
        log.seek(0)
        last = log.read().strip().splitlines()[-1:]
        return _missing("; ".join([problem, *last]), "nodes cannot communicate on this machine", TRANSPORT_REMEDY)


def _call(namespace: str, alive: Callable[[], bool]) -> str:
    """Request one prediction; returns what went wrong, empty if nothing did."""
    import rclpy
    from rclpy.node import Node

    from push_predictor_interfaces.srv import PredictPush

    rclpy.init(args=[])
    try:
        node = Node("doctor", namespace=namespace)
        client, deadline = node.create_client(PredictPush, "predict_push"), time.monotonic() + PATIENCE
        while not client.wait_for_service(0.2):
            if not alive():
                return "predict_server ended"
            if time.monotonic() > deadline:
                return f"predict_server was not found within {PATIENCE:.0f} s"
        response, deadline = None, time.monotonic() + PATIENCE
        while (
            response is None and time.monotonic() < deadline
        ):  # an answer is lost while client and server discover each other
            future = client.call_async(PredictPush.Request(**PUSH))
            rclpy.spin_until_future_complete(node, future, timeout_sec=AGAIN)
            response = future.result() if future.done() else None
        if response is None:
            return f"predict_push did not answer within {PATIENCE:.0f} s"
        return "" if response.success else f"predict_push was refused: {response.message}"
    finally:
        rclpy.try_shutdown()


def _report(name: str, check: Callable[[], dict[str, str]]) -> bool:
    """Run a check and print its finding; returns whether it passed."""
    print(json.dumps({"name": name}), flush=True)
    found = {"name": name, **check()}
    print(json.dumps(found), flush=True)
    return found["state"] != "missing"


def _kind(package: str) -> str:
    return "srv" if package == "std_srvs" else "msg"


def _imports(module: str) -> bool:
    try:
        importlib.import_module(module)
    except Exception:  # a generated module whose library does not load raises many kinds
        return False
    return True


def _has(name: str, field: str) -> bool:
    """Whether an interface such as srv.PredictPush.Response has this field."""
    kind, *path = name.split(".")
    found: Any = importlib.import_module(f"push_predictor_interfaces.{kind}")
    for part in path:
        found = getattr(found, part, None)
    return found is not None and field in found.get_fields_and_field_types()


def _finding(state: str, found: str, why: str = "", remedy: str = "") -> dict[str, str]:
    return {"state": state, "found": " ".join(found.split()), "why": why, "remedy": remedy}


def _ok(found: str) -> dict[str, str]:
    return _finding("ok", found)


def _missing(found: str, why: str, remedy: str) -> dict[str, str]:
    return _finding("missing", found, why, remedy)


if __name__ == "__main__":
    sys.exit(main())

"""Who on the network may meet a node: discovery, and whether the security that was asked for is there."""

from __future__ import annotations

import os
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier

from push_predictor.errors import PushPredictorError

RANGE, ENABLE = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_SECURITY_ENABLE"
DISCOVERY = (RANGE, "ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER", "ROS_LOCALHOST_ONLY")  # one that is set tells how far
LIMITED = (
    f"other machines cannot find this node, {RANGE} is not set: export {RANGE}=SUBNET on all of them if they should"
)


class SecurityError(PushPredictorError):
    """Security was asked for and cannot be had."""


def limit_discovery() -> bool:
    """Keep to this machine unless the environment tells how far to look; before rclpy.init. Answers if it was limited.

    Nodes on this machine find each other all the same, also those with the wider range that ROS has by default.
    """
    if any(os.environ.get(name) for name in DISCOVERY):
        return False
    os.environ[RANGE] = "LOCALHOST"
    return True


def require_security() -> None:
    """Raise SecurityError if the environment asks for security that the middleware was not built with.

    rcl would go on without a word where ROS_SECURITY_STRATEGY is not Enforce: the node would be open to everybody.
    """
    asked = os.environ.get(ENABLE, "")
    if asked.lower() in ("", "false", "0", "no", "off"):
        return
    if asked != "true":
        raise SecurityError(f"{ENABLE}={asked} secures nothing, ROS knows the word true alone: write that, or unset it")
    if not security_compiled_in():
        raise SecurityError(
            f"{ENABLE}=true, but {get_rmw_implementation_identifier()} was built without DDS security: take one "
            f"with it, as in the Debian packages of ROS, or unset {ENABLE}; docs/how_to/security.md"
        )


def security_hint() -> str:
    """What to look at when a node that should be secured cannot be made; empty if none should be."""
    if os.environ.get(ENABLE) != "true":
        return ""
    names = (ENABLE, "ROS_SECURITY_STRATEGY", "ROS_SECURITY_KEYSTORE", "ROS_SECURITY_ENCLAVE_OVERRIDE")
    given = ", ".join(f"{name}={os.environ.get(name, '')}" for name in names)
    return f"; security was asked for ({given}): is there an enclave for the node? docs/how_to/security.md"


def security_compiled_in() -> bool:
    """Whether the middleware could protect a node: it is asked for one with an enclave that holds no key.

    The refusal tells: Fast DDS and Cyclone DDS name the switch SECURITY=ON that they were built without. No node
    comes into being either way.
    """
    with tempfile.TemporaryDirectory(prefix="push_predictor_enclave_") as keystore:
        Path(keystore, "enclaves", "none").mkdir(parents=True)
        wanted = {ENABLE: "true", "ROS_SECURITY_STRATEGY": "Enforce", "ROS_SECURITY_KEYSTORE": keystore}
        with _environment({**wanted, "ROS_SECURITY_ENCLAVE_OVERRIDE": "/none"}), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a node that half exists
            return "SECURITY=ON" not in _refusal()


def _refusal() -> str:
    """Why no node can be made."""
    context = Context()
    set_logger_level("rcl", LoggingSeverity.WARN)  # it would tell where the keystore lies
    try:
        context.init(args=[])
        Node("probe", context=context).destroy_node()
        return ""
    except rclpy_implementation.RCLError as error:
        return str(error)
    finally:
        context.try_shutdown()
        set_logger_level("rcl", LoggingSeverity.UNSET)


@contextmanager
def _environment(wanted: Mapping[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value

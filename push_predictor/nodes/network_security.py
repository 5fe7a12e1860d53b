# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Which machines can discover a node, and whether the security that the environment requests is available."""

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
DISCOVERY = (RANGE, "ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER", "ROS_LOCALHOST_ONLY")  # any of them sets the range
LIMITED = f"Other machines cannot discover this node. To allow it, export {RANGE}=SUBNET on all machines."
SECURITY_PAGE = "docs/how_to/security.md"


class SecurityError(PushPredictorError):
    """The environment requests security that is not available."""


def limit_discovery() -> bool:
    """Limit discovery to this machine unless the environment sets a range; returns whether it was limited.

    Call it before rclpy.init. Nodes on this machine still discover each other, also those with ROS's wider default.
    """
    if any(os.environ.get(name) for name in DISCOVERY):
        return False
    os.environ[RANGE] = "LOCALHOST"
    return True


def require_security() -> None:
    """Raise SecurityError if the environment requests security that the middleware was built without.

    Unless ROS_SECURITY_STRATEGY is Enforce, rcl would start an unprotected node without a warning.
    """
    requested = os.environ.get(ENABLE, "")
    if requested.lower() in ("", "false", "0", "no", "off"):
        return
    if requested != "true":
        raise SecurityError(
            f"{ENABLE}={requested} does not enable security: ROS accepts only true. Set that, or unset it"
        )
    if not security_compiled_in():
        raise SecurityError(
            f"{ENABLE}=true, but {get_rmw_implementation_identifier()} was built without DDS security. Install a "
            f"middleware with security, such as ROS's Debian packages, or unset {ENABLE}; see {SECURITY_PAGE}"
        )


def security_hint() -> str:
    """What to check when a node that requests security cannot be created; empty if it does not."""
    if os.environ.get(ENABLE) != "true":
        return ""
    names = (ENABLE, "ROS_SECURITY_STRATEGY", "ROS_SECURITY_KEYSTORE", "ROS_SECURITY_ENCLAVE_OVERRIDE")
    given = ", ".join(f"{name}={os.environ.get(name, '')}" for name in names)
    return (
        f"; security is requested ({given}). Check that the keystore has an enclave for the node; see {SECURITY_PAGE}"
    )


def security_compiled_in() -> bool:
    """Whether the middleware supports security, tried out with an enclave without a key.

    No node is created either way: Fast DDS and Cyclone DDS built without security name the switch SECURITY=ON in their
    error.
    """
    with tempfile.TemporaryDirectory(prefix="push_predictor_enclave_") as keystore:
        Path(keystore, "enclaves", "none").mkdir(parents=True)
        wanted = {ENABLE: "true", "ROS_SECURITY_STRATEGY": "Enforce", "ROS_SECURITY_KEYSTORE": keystore}
        with _environment({**wanted, "ROS_SECURITY_ENCLAVE_OVERRIDE": "/none"}), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about the half-created node
            return "SECURITY=ON" not in _creation_error()


def _creation_error() -> str:
    """The error of creating a node, empty if there is none."""
    context = Context()
    set_logger_level("rcl", LoggingSeverity.WARN)  # otherwise it logs where the keystore lies
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

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Which machines can discover a node, and whether the security that the environment requests is available.

As a program, for `push_predictor doctor`: create a node, and print what it discovers.
"""

from __future__ import annotations

import os
import time
from importlib import import_module

from push_predictor.errors import PushPredictorError

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
ENABLE, STRATEGY = "ROS_SECURITY_ENABLE", "ROS_SECURITY_STRATEGY"
DISCOVERY = (RANGE, "ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER", "ROS_LOCALHOST_ONLY")  # any of them sets the range
LIMITED = f"Other machines cannot discover this node. To allow it, export {RANGE}=SUBNET on all machines."
SECURITY_PAGE = "docs/how_to/security.md"
USED = (
    "geometry_msgs.msg",
    "visualization_msgs.msg",
    "push_predictor_interfaces.srv",
)  # of the packages that all nodes need
PATIENCE = 1.0  # s to discover other nodes


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
    """Let rcl refuse to create a node without the security that the environment requests, whatever the reason.

    By default rcl would start an unprotected node without a warning where there are no keys. Raises SecurityError for a
    request that rcl would ignore.
    """
    requested = os.environ.get(ENABLE, "")
    if requested.lower() in ("", "false", "0", "no", "off"):
        return
    if requested != "true":
        raise SecurityError(
            f"{ENABLE}={requested} does not enable security: ROS accepts only true. Set that, or unset it"
        )
    os.environ[STRATEGY] = "Enforce"


def security_hint() -> str:
    """What to check when a node that requests security cannot be created; empty if none is requested."""
    if os.environ.get(ENABLE) != "true":
        return ""
    names = (ENABLE, STRATEGY, "ROS_SECURITY_KEYSTORE", "ROS_SECURITY_ENCLAVE_OVERRIDE")
    given = ", ".join(f"{name}={os.environ.get(name, '')}" for name in names)
    checks = "the middleware was built with DDS security, and that the keystore has an enclave for the node"
    return f"; security is requested ({given}). Check that {checks}; see {SECURITY_PAGE}"


def main() -> None:
    """Print the middleware, the domain and the other nodes. Raises what rclpy or the middleware raises."""
    import rclpy
    from rclpy.utilities import get_rmw_implementation_identifier

    for name in USED:
        import_module(name)
    limited = limit_discovery()
    require_security()
    try:
        rclpy.init(args=[])
        node = rclpy.create_node("push_predictor_doctor")
    except Exception as error:
        raise SystemExit(f"{error}{security_hint()}") from None
    time.sleep(PATIENCE)
    names = sorted(f"{space.rstrip('/')}/{name}" for name, space in node.get_node_names_and_namespaces())
    others = ", ".join(name for name in names if name != node.get_fully_qualified_name()) or "none"
    reach = "on this machine" if limited else "in the discovery range of the environment"
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    print(f"{get_rmw_implementation_identifier()}, domain {domain}, other nodes {reach}: {others}")
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()

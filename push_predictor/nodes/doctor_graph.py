# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The check of ROS by `push_predictor doctor`, in a process of its own: a node is created, and prints what it sees."""

from __future__ import annotations

import os
import time

import geometry_msgs.msg
import rclpy
import visualization_msgs.msg
from rclpy.utilities import get_rmw_implementation_identifier

import push_predictor_interfaces.srv
from push_predictor.nodes.network_security import limit_discovery, require_security, security_hint

DISCOVERY = 1.0  # s to discover other nodes
USED = (geometry_msgs.msg.PoseStamped, visualization_msgs.msg.MarkerArray, push_predictor_interfaces.srv.PredictPush)


def main() -> None:
    """Print the middleware, the domain and the other nodes. Raises what rclpy or the middleware raises."""
    limited = limit_discovery()
    require_security()
    try:
        rclpy.init(args=[])
        node = rclpy.create_node("push_predictor_doctor")
    except Exception as error:
        raise SystemExit(f"{error}{security_hint()}") from None
    time.sleep(DISCOVERY)
    names = sorted(f"{space.rstrip('/')}/{name}" for name, space in node.get_node_names_and_namespaces())
    others = ", ".join(name for name in names if name != node.get_fully_qualified_name()) or "none"
    reach = "on this machine" if limited else "in the discovery range of the environment"
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    print(f"{get_rmw_implementation_identifier()}, domain {domain}, other nodes {reach}: {others}")
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()

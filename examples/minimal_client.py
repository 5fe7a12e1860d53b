# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Ask predict_server which push along a side turns a square most surely: `python -m examples.minimal_client`."""

import numpy as np
import rclpy

from push_predictor_interfaces.srv import PredictPushBatch

rclpy.init()
node = rclpy.create_node("planner")
client = node.create_client(PredictPushBatch, "predict_push_batch")
if not client.wait_for_service(timeout_sec=10.0):
    raise SystemExit("predict_server is not running")
contact = np.linspace(0.01, 0.24, 20)  # fraction of the perimeter: the first side of a square
request = PredictPushBatch.Request(velocity=[0.02] * 20, contact=contact.tolist(), angle=[0.0] * 20)
future = client.call_async(request)
rclpy.spin_until_future_complete(node, future, timeout_sec=5.0)
answer = future.result()
if answer is None or not answer.success:
    raise SystemExit(answer.message if answer else "no answer")
turn = np.reshape(answer.mean, (20, 3))[:, 2]  # of dx, dy (m), dtheta (rad)
deviation = np.sqrt(np.reshape(answer.covariance, (20, 3, 3))[:, 2, 2])
best = int(np.argmax(np.where(answer.in_domain, np.abs(turn) - 2.0 * deviation, -np.inf)))
print(f"contact {contact[best]:.3f}: turns by {turn[best]:.3f} rad, standard deviation {deviation[best]:.3f} rad")
rclpy.shutdown()

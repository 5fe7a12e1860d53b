# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A predict_server in a process of its own, and a client of all its services."""

from __future__ import annotations

import contextlib
import functools

import numpy as np
import ros_harness as harness
from diagnostic_msgs.msg import DiagnosticArray
from hosted_nodes import hosted_node
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters
from rclpy.qos import QoSProfile

from msg_adapters.predictions import PushQuery, query_to_batch_request, query_to_request
from push_predictor_interfaces.srv import ListModels, LoadModel, PredictPush, PredictPushBatch

SERVICES = {
    "predict_push": PredictPush,
    "predict_push_batch": PredictPushBatch,
    "list_models": ListModels,
    "load_model": LoadModel,
    "push_predictor/change_state": ChangeState,
    "push_predictor/set_parameters": SetParameters,
    "push_predictor/get_parameters": GetParameters,
    "push_predictor/describe_parameters": DescribeParameters,
    "push_predictor/get_state": GetState,  # last: the node has found all the others when this one is answered
}
GOOD = np.array([0.02, 0.1, 0.2])
MANY = np.column_stack([np.full(20, 0.02), np.linspace(0.01, 0.99, 20), np.linspace(-0.9, 0.9, 20)])


class Server:
    """A running predict_server and a client for it."""

    def __init__(self, process, node) -> None:
        self.process, self.node = process, node
        self._clients = {
            name: node.create_client(kind, name, qos_profile=QoSProfile(depth=100)) for name, kind in SERVICES.items()
        }
        self.statuses: list = []
        node.create_subscription(DiagnosticArray, "/diagnostics", lambda m: self.statuses.extend(m.status), 10)

    def call(self, name, request):
        return harness.call(self._clients[name], request)

    def push(self, push=GOOD, duration=0.2, model="", covariates=None, residual=None):
        return self.call("predict_push", query_to_request(model, np.asarray(push), duration, covariates, residual))

    def batch(self, inputs, duration=0.2, model="", covariates=None):
        query = PushQuery(model, np.asarray(inputs, dtype=float).reshape(-1, 3), duration, covariates or {})
        return self.call("predict_push_batch", query_to_batch_request(query))

    def load(self, path, name="", make_default=False):
        return self.call("load_model", LoadModel.Request(path=str(path), name=name, make_default=make_default))

    def list(self):
        return self.call("list_models", ListModels.Request())

    def state(self):
        return self.call("push_predictor/get_state", GetState.Request()).current_state.label

    def change(self, transition):
        request = ChangeState.Request(transition=Transition(id=transition))
        return self.call("push_predictor/change_state", request).success

    def set(self, name, value):
        kinds = {
            str: (ParameterType.PARAMETER_STRING, "string_value"),
            float: (ParameterType.PARAMETER_DOUBLE, "double_value"),
        }
        if isinstance(value, list):
            kind, field = ParameterType.PARAMETER_STRING_ARRAY, "string_array_value"
        else:
            kind, field = kinds[type(value)]
        parameter = Parameter(name=name, value=ParameterValue(**{"type": kind, field: value}))
        return self.call("push_predictor/set_parameters", SetParameters.Request(parameters=[parameter])).results[0]

    def next_status(self, ready=lambda status: True):
        """The first status from now on that is ready."""
        self.statuses.clear()
        found = []

        def seen() -> bool:
            found[:] = [s for s in list(self.statuses) if ready(s)]
            return bool(found)

        assert harness.wait_until(seen, 60.0), f"no such diagnostics among {self.statuses}\n{self.process.text()}"
        return found[0], {pair.key: pair.value for pair in found[0].values}


@contextlib.contextmanager
def server_of(models, start=harness.node_process, client=Server, **params):
    """A server in a process of its own, and a client of it."""
    params = {"models": [str(path) for path in models], "diagnostics_period": 0.2, **params}
    with (
        harness.reserved_domain() as domain,
        start("predict_server", domain=domain, params=params) as process,
        harness.ros_context(domain) as node,
    ):
        server = client(process, node)
        server.state()  # the node answers
        yield server


hosted_server_of = functools.partial(server_of, start=hosted_node)  # which starts and ends in a tenth of the time

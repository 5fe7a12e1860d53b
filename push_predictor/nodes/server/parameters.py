# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of predict_server."""

from __future__ import annotations

from rclpy.service_introspection import ServiceIntrospectionState

from push_predictor.nodes.parameters import Param
from push_predictor.resources import SHIPPED

INTROSPECTION = {
    "disabled": ServiceIntrospectionState.OFF,
    "metadata": ServiceIntrospectionState.METADATA,
    "contents": ServiceIntrospectionState.CONTENTS,
}
PARAMETERS = (
    Param(
        "models",
        [SHIPPED],
        "Model files, and folders of them, to load on configuration. 'default' is the shipped model.",
    ),
    Param(
        "default_model",
        "",
        "Name of the model for requests that name none. Empty: the first one loaded.",
        read_only=False,
    ),
    Param("world_frame", "world", "Frame in which sliders lie flat, with z up."),
    Param("autostart", True, "Configure and activate at start, without a lifecycle manager."),
    Param(
        "introspection",
        "disabled",
        "Service events on NAME/_service_event: none, metadata only, or metadata and contents.",
        choices=tuple(INTROSPECTION),
        read_only=False,
    ),
    Param("diagnostics_period", 1.0, "Seconds between two messages on /diagnostics.", low=0.1, high=60.0),
    Param(
        "trace_alpha",
        0.01,
        "Largest probability that trace_residual reports an effect where there is none.",
        low=1e-6,
        high=0.5,
        read_only=False,
    ),
)

"""The parameters of predict_server, and the values of one of them."""

from __future__ import annotations

from rclpy.service_introspection import ServiceIntrospectionState

from push_predictor.models.store.model_registry import SHIPPED
from push_predictor.nodes.parameters import Param

INTROSPECTION = {
    "disabled": ServiceIntrospectionState.OFF,
    "metadata": ServiceIntrospectionState.METADATA,
    "contents": ServiceIntrospectionState.CONTENTS,
}
PARAMETERS = (
    Param(
        "models",
        [SHIPPED],
        "Model files, and folders of them, loaded when the node is configured; 'default': the shipped one.",
    ),
    Param(
        "default_model",
        "",
        "Name of the model that a request without a name gets; empty: the first loaded.",
        read_only=False,
    ),
    Param("world_frame", "world", "Frame in which sliders lie flat: z points up, poses are read in it."),
    Param("autostart", True, "Configure and activate without a lifecycle manager."),
    Param(
        "introspection",
        "disabled",
        "Service events on NAME/_service_event: none, metadata, or requests and responses too.",
        choices=tuple(INTROSPECTION),
        read_only=False,
    ),
    Param("diagnostics_period", 1.0, "Seconds between two messages on /diagnostics.", low=0.1, high=60.0),
    Param(
        "trace_alpha",
        0.01,
        "Probability, at most, that trace_residual finds an effect where there is none.",
        low=1e-6,
        high=0.5,
        read_only=False,
    ),
)

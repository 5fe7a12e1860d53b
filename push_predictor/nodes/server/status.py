"""How a predict_server does, as one diagnostic status (docs/reference/predict_server.md, "Diagnostics")."""

from __future__ import annotations

from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticStatus

from msg_adapters.diagnostics import Level, diagnostic_status
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.nodes.server.request_log import RequestLog

NO_MODEL = "no model is loaded, give the parameter 'models' or call load_model"


def server_status(
    node_name: str, state: str, shelf: ModelRegistry, problems: Sequence[str], log: RequestLog
) -> DiagnosticStatus:
    """The status of a node in a lifecycle state; problems: what could not be loaded, a line each."""
    level, message = _health(state, shelf, problems)
    values = {
        "state": state,
        "models": shelf.names,
        "default_model": shelf.default,
        "answers": shelf.answering,
        "problems": "; ".join(problems) or None,
        **log.values(),
    }
    return diagnostic_status(f"{node_name}: predictions", level, message, values)


def _health(state: str, shelf: ModelRegistry, problems: Sequence[str]) -> tuple[Level, str]:
    if not shelf.names:
        return Level.ERROR, NO_MODEL
    if state != "active":
        return Level.WARN, f"the node is {state}"
    if shelf.default not in shelf.names:
        return Level.WARN, f"default_model {shelf.default!r} is not loaded"
    if problems:
        return Level.WARN, f"{len(problems)} of the models could not be loaded"
    return Level.OK, f"{len(shelf.names)} models are served"

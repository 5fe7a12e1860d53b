"""How a push_validator does, as one diagnostic status (docs/validation.md, "Diagnostics")."""

from __future__ import annotations

from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticStatus

from msg_adapters.diagnostics import Level, diagnostic_status
from push_predictor.evaluation.offline import rig_difference
from push_predictor.nodes.prediction_client import PredictionClient
from push_predictor.nodes.sensor_inlet import SensorInlet
from push_predictor.nodes.validation_run import ValidationRun


def validator_status(
    name: str,
    state: str,
    run: ValidationRun | None,
    inlet: SensorInlet,
    client: PredictionClient,
    problems: Sequence[str],
    failure: str,
) -> DiagnosticStatus:
    """problems: of models and rig, in words. failure: why a result could not be written, empty if it could."""
    warnings = [*problems, *inlet.problems(), *client.problems, *(_run_problems(run) if run else [])]
    if not client.server_is_there:
        warnings.append("nobody offers predict_push")
    level = Level.ERROR if failure else Level.WARN if warnings else Level.OK
    values: dict[str, object] = {"state": state, **inlet.figures(), "open requests": client.open}
    values |= {"timeouts": client.timeouts, "refused": run.refused if run else 0}
    if run is not None:
        values |= {f"streams {kind}": count for kind, count in run.counts.items()} | _scores(run)
    return diagnostic_status(name, level, "; ".join(filter(None, [failure, *warnings])) or state, values)


def _run_problems(run: ValidationRun) -> list[str]:
    found = [difference for model in run.validation.models if (difference := rig_difference(model, run.rig))]
    if run.refused:
        found.append(f"{run.refused} predictions refused, the last one: {run.last_refusal}")
    return found


def _scores(run: ValidationRun) -> dict[str, object]:
    pairs = zip(run.validation.names, run.validation.scores, strict=True)
    return {f"{name} {key}": value for name, score in pairs for key, value in score.values().items()}

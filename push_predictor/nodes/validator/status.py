"""How a push_validator does, as one diagnostic status (docs/reference/push_validator.md, "Diagnostics")."""

from __future__ import annotations

from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticStatus

from msg_adapters.diagnostics import Level, diagnostic_status
from push_predictor.evaluation.alarm.evidence import AlarmState
from push_predictor.evaluation.offline import rig_difference
from push_predictor.nodes.validator.prediction_client import PredictionClient
from push_predictor.nodes.validator.sensor_subscriber import SensorSubscriber
from push_predictor.nodes.validator.validation_run import ValidationRun
from push_predictor.online.alarm_process import PushAlarm
from push_predictor.recordings.windows.stream_faults import fault_words


def validator_status(
    name: str,
    state: str,
    run: ValidationRun | None,
    inlet: SensorSubscriber,
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
        values |= _stream_figures(run) | _scores(run)
        values |= _alarm(run.alarm) | ({"kept windows": str(run.table.path)} if run.table else {})
    return diagnostic_status(name, level, "; ".join(filter(None, [failure, *warnings])) or state, values)


def _stream_figures(run: ValidationRun) -> dict[str, object]:
    """Faults by kind, "streams KIND" of all streams and "slider KIND" of one."""
    found: dict[str, object] = {k if " " in k else f"streams {k}": count for k, count in run.counts.items()}
    found["contact from"] = "geometry and force" if run.pace.with_wrench else "geometry alone: no wrench has come"
    apart = run.pace.apart()
    found["streams clocks_apart"] = len(apart)
    return found | {f"{name} ahead of slider": lag for name, lag in apart.items()}


def _run_problems(run: ValidationRun) -> list[str]:
    found = [difference for model in run.validation.models if (difference := rig_difference(model, run.rig))]
    found += [*run.pace.problems(), *fault_words(run.counts)]
    if run.refused:
        found.append(f"{run.refused} predictions refused, the last one: {run.last_refusal}")
    if run.table_failure:
        found.append(run.table_failure)
    if run.alarm is not None:
        found += _alarm_problems(run.alarm)
    return found


def _alarm_problems(alarm: PushAlarm) -> list[str]:
    found = []
    if alarm.state is not None and alarm.state.fired:
        found.append(fired_text(alarm.state))
    if alarm.skipped:
        found.append(f"{len(alarm.skipped)} pushes are unknown to the alarm, the last one: {alarm.skipped[-1]}")
    return found


def fired_text(state: AlarmState) -> str:
    """In words, when the alarm fired and why."""
    return (
        f"the model no longer fits what is seen: alarm at push {state.fired_at}, the {state.fired_after}th, evidence "
        f"10^{state.fired_evidence:.2f} of {state.fired_by}, false at most once in {1.0 / state.false_alarm_rate:g}"
    )


def _alarm(alarm: PushAlarm | None) -> dict[str, object]:
    if alarm is None or alarm.state is None:
        return {"alarm": alarm.off or "no push was judged"} if alarm else {}
    state = alarm.state
    values: dict[str, object] = {"alarm": "fired" if state.fired else "quiet", "alarm pushes": state.pushes}
    values |= {"alarm log10 evidence": state.log10_evidence, "alarm strongest": state.strongest}
    fired = {"alarm push": state.fired_at, "alarm fired log10 evidence": state.fired_evidence}
    return values | (fired if state.fired else {})


def _scores(run: ValidationRun) -> dict[str, object]:
    pairs = zip(run.validation.names, run.validation.scores, strict=True)
    return {f"{name} {key}": value for name, score in pairs for key, value in score.values().items()}

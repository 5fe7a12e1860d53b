# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The health of a push_validator: a diagnostic status, and a line in the log for each new problem."""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

from msg_adapters.diagnostics import diagnostic_array, diagnostic_status, level_of
from push_predictor.evaluation.alarm.evidence import alarm_json, alarm_sentence
from push_predictor.evaluation.offline import rig_difference
from push_predictor.nodes.rig_source import RigSource
from push_predictor.nodes.validator.results import ResultWriter
from push_predictor.nodes.validator.sensor_subscriber import SensorSubscriber
from push_predictor.nodes.validator.server_client import ModelSource, PredictionClient
from push_predictor.nodes.validator.validation_run import ValidationRun
from push_predictor.online.alarm_process import AlarmProcess
from push_predictor.online.news import News
from push_predictor.online.session import SILENCE, Session, State
from push_predictor.recordings.windows.stream_faults import describe_faults

SILENT = f"No usable sample for {SILENCE:g} s. Call `~/finish` to write the results."
NO_SERVER = "No node offers predict_push. Start predict_server."


class StatusPublisher:
    """Publishes the status of a validator on /diagnostics, and logs problems when they change."""

    def __init__(
        self,
        node: Node,
        session: Session,
        models: ModelSource,
        rigs: RigSource,
        sensors: SensorSubscriber,
        client: PredictionClient,
        writer: ResultWriter,
    ) -> None:
        self._node, self._session, self._writer = node, session, writer
        self._models, self._rigs, self._sensors, self._client = models, rigs, sensors, client
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._state_news, self._finding_news = News(at_once=True), News(at_once=True)
        self._refusals, self._topic_news = News(at_once=True), News()

    def publish(self, run: ValidationRun | None) -> None:
        """Publish the status of this moment. run: the present one or the last."""
        self._log_topics()
        self._log_problems(run)
        status = self._status(run, self._problems(run))
        self._publisher.publish(diagnostic_array(self._node.get_clock().now().nanoseconds, status))

    def why_nothing(self) -> str:
        """Why there was no run: what is missing of model, rig and samples, in words."""
        return _paragraph(["Nothing was validated", *self._problems(None), *self._sensors.problems()])

    def _log_problems(self, run: ValidationRun | None) -> None:
        """Log new problems, and which have ended; what was found in a run stays true of it."""
        log, states, found = self._node.get_logger(), self._states(run), _found(run)
        for gone in self._state_news.gone(states):
            log.info(f"no longer: {gone}")
        for problem in [
            *self._state_news.of(dict.fromkeys(states, "")),
            *self._finding_news.of(dict.fromkeys(found, "")),
        ]:
            log.warning(problem)

    def _log_topics(self) -> None:
        """Log a line for each topic of which something has changed."""
        log = self._node.get_logger()
        reports = {report.stream: report for report in self._sensors.inspect()}
        keys = {stream: report.key for stream, report in reports.items()}
        refused = {stream: key for stream, key in keys.items() if reports[stream].refused}
        others = {stream: key for stream, key in keys.items() if stream not in refused}
        for stream in [*self._refusals.of(refused), *self._topic_news.of(others)]:
            report = reports[stream]
            if report.refused:  # one line each: rclpy binds the severity to the place of the call
                log.error(report.line)
            elif report.problem:
                log.warning(report.line)
            else:
                log.info(report.line)

    def _problems(self, run: ValidationRun | None) -> list[str]:
        return [*self._states(run), *_found(run)]

    def _states(self, run: ValidationRun | None) -> list[str]:
        """What is wrong now, and may end."""
        unsaved = run.files.failure if run and run.files else ""
        silent = SILENT if self._session.silent(monotonic()) else ""
        found = [*(self._models.problems or [self._models.missing]), self._rigs.problem, unsaved, silent]
        return [*filter(None, dict.fromkeys([*found, *self._client.problems]))]

    def _status(self, run: ValidationRun | None, problems: Sequence[str]) -> DiagnosticStatus:
        """ERROR for a failure, a refused topic or refused samples, WARN for a problem."""
        sensors, client, rig, failure = self._sensors, self._client, self._rigs.rig, self._session.failure
        warnings = [*problems, *sensors.problems(), *(_run_problems(run) if run else [])]
        if not client.server_available:
            warnings.append(NO_SERVER)
        wrong = failure or sensors.refused or (run is not None and run.checks.check.failed)
        level = level_of(wrong, warnings)
        state = self._activity()
        values: dict[str, object] = {"state": state, **sensors.figures(), "open requests": client.open}
        values |= {"timeouts": client.timeouts, "refused": run.refused if run else 0}
        if run is not None:
            values |= _stream_figures(run, sensors) | _scores(run) | _checks(run)
            values |= _alarm_figures(run.alarm) | ({"kept windows": str(run.files.path)} if run.files else {})
        message, name = _paragraph([failure, *warnings]) or state, self._node.get_fully_qualified_name()
        return diagnostic_status(name, "validation", level, message, values, rig.shape if rig else "")

    def _activity(self) -> str:
        if self._session.state is State.DRAINING:
            return "waiting for the last answers"
        if self._writer.report.alive:
            return "writing the report"
        return "validating" if self._session.active else "waiting for samples"


def _found(run: ValidationRun | None) -> list[str]:
    """What the checks found in a run."""
    found = [*run.checks.check.problems, *(finding.text for finding in run.coverage or [])] if run else []
    return [*dict.fromkeys(found)]


def _paragraph(texts: Sequence[str]) -> str:
    """The texts that are not empty as sentences, one after the other."""
    return " ".join(text if text.endswith((".", "?")) else f"{text}." for text in texts if text)


def _stream_figures(run: ValidationRun, sensors: SensorSubscriber) -> dict[str, object]:
    """Faults by kind, "streams KIND" of all streams and "slider KIND" of one."""
    found: dict[str, object] = {k if " " in k else f"streams {k}": count for k, count in run.finder.counts.items()}
    without = "the wrench waits for its bias" if sensors.waits_for_bias else "no wrench received"
    found["contact from"] = "geometry and force" if run.sync.with_wrench else f"geometry alone: {without}"
    jitter = "regular, in place of stamps with a jitter of {:.2g} ms"
    found |= {f"{name} stamps": jitter.format(1e3 * value) for name, value in run.finder.stamp_jitter.items()}
    apart = run.sync.apart()
    found["streams clocks_apart"] = len(apart)
    return found | {f"{name} ahead of slider": lag for name, lag in apart.items()}


def _run_problems(run: ValidationRun) -> list[str]:
    found = [difference for model in run.validation.models if (difference := rig_difference(model, run.rig))]
    found += [*run.sync.problems(), *describe_faults(run.finder.counts)]
    if run.refused:
        found.append(f"predict_push refused {run.refused} requests. The last, of model {run.last_refusal}")
    if run.alarm is not None:
        found += _alarm_problems(run.alarm)
    return found


def _alarm_problems(alarm: AlarmProcess) -> list[str]:
    found = []
    if alarm.state is not None and alarm.state.fired:
        found.append(alarm_sentence(alarm_json(alarm.state)))
    if alarm.skipped:
        found.append(f"The alarm skipped {len(alarm.skipped)} pushes. The last, {alarm.skipped[-1]}")
    return found


def _alarm_figures(alarm: AlarmProcess | None) -> dict[str, object]:
    if alarm is None or alarm.state is None:
        return {"alarm": alarm.off or "no push scored yet"} if alarm else {}
    state = alarm.state
    values: dict[str, object] = {"alarm": "fired" if state.fired else "quiet", "alarm pushes": state.pushes}
    values |= {"alarm log10 evidence": state.log10_evidence, "alarm strongest": state.strongest}
    fired = {"alarm push": state.fired_at, "alarm fired log10 evidence": state.fired_evidence}
    return values | (fired if state.fired else {})


def _checks(run: ValidationRun) -> dict[str, object]:
    """Results of the checks of the samples and, at the end of a run, of what its pushes cover."""
    coverage = "not checked yet" if run.coverage is None else "limited" if run.coverage else "sufficient"
    return {"data check": run.checks.check.result, "coverage check": coverage}


def _scores(run: ValidationRun) -> dict[str, object]:
    pairs = zip(run.validation.names, run.validation.scores, strict=True)
    return {f"{name} {key}": value for name, score in pairs for key, value in score.values().items()}

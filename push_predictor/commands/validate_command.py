# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor validate: compare predictions with a recording, as push_validator does online."""

from __future__ import annotations

import argparse
from pathlib import Path

from push_predictor.commands.common.command import Option, Output, command
from push_predictor.commands.common.options import READING, Reading, model_argument
from push_predictor.commands.common.output import warn, write_json
from push_predictor.commands.common.progress import progress
from push_predictor.errors import RequestError
from push_predictor.watch import part_of

BEFORE_ALARM, BEFORE_ADAPTING = 0.2, 0.6  # shares of the time for windows and predictions, and for the alarm too


@command(
    "validate",
    "Compare a model's predictions with a recording, window by window. Prints whether the model fits, the scores, "
    "and the alarm with its evidence.",
    "push_predictor validate square_abs.pushmodel bags/square_abs_test --json validation.json",
    model_argument(),
    Option("recording", type=Path, metavar="RECORDING", help="a folder, .mcap, .db3 or .bag file"),
    Option(
        "--false-alarm-rate",
        type=float,
        default=0.01,
        metavar="R",
        help="largest probability that the alarm fires without a change (default %(default)s)",
    ),
    Output("--windows", type=Path, metavar="FILE.json", help="write prediction and outcome of every window"),
    Output(
        "--adapt",
        type=Path,
        nargs="?",
        const=Path("adaptation.png"),
        metavar="PICTURE.png",
        help="let the model follow the pushes too: print and draw errors and parameters push by push (default "
        "%(const)s)",
    ),
    Option(
        "--extended", type=Path, metavar="TRACED", help="with --adapt: a further model to compare, as that of a trace"
    ),
    *READING,
)
def run(options: argparse.Namespace) -> None:
    """Compare, print the scores, and warn about training pushes and other sliders."""
    from push_predictor.adaptation.followed import follow
    from push_predictor.evaluation.alarm.evidence import alarm_sentence
    from push_predictor.evaluation.alarm.scores import recording_alarm
    from push_predictor.evaluation.judgement import judged
    from push_predictor.evaluation.metrics import metrics_lines
    from push_predictor.evaluation.offline import remarks, validate_recording
    from push_predictor.evaluation.report.summary import opening_sentences
    from push_predictor.evaluation.validation import metrics_json, trained_on
    from push_predictor.models.store.model_file import load_model
    from push_predictor.online.live_validation import write_window_log
    from push_predictor.recordings.load import required_rig
    from push_predictor.recordings.windows.push_window import windows_to_table

    if options.extended and not options.adapt:
        raise RequestError("--extended", str(options.extended), "only together with --adapt")
    _check_recording(options.recording)
    model = load_model(options.model)
    reading = Reading(options)
    rig = reading.rig or required_rig(options.recording)
    with progress("validate") as watch:
        watch("windows and predictions", 0.0)
        judging = part_of(watch, BEFORE_ALARM, BEFORE_ADAPTING if options.adapt else 1.0)
        windows, comparison = validate_recording(model, options.recording, rig, warn, reading.topics, reading.checks)
        reading.save_topics([options.recording])
        table = windows_to_table(windows)
        alarm = recording_alarm(model, table, comparison, options.false_alarm_rate, judging)
        metrics = {**metrics_json(comparison), "n_training_pushes": len(trained_on(model, table)), "alarm": alarm}
        metrics["judgement"] = judged(metrics).sentence
        extended = load_model(options.extended) if options.extended else None
        followed = follow(model, table, extended, part_of(watch, BEFORE_ADAPTING, 1.0)) if options.adapt else None
    for text in remarks(model, rig, table):
        warn(text)
    if options.windows:
        write_window_log(options.windows, windows, comparison)
    if followed is not None:
        metrics["adaptation"] = followed.json
        followed.draw(options.adapt)
    if not write_json(options, metrics):
        print("\n".join(opening_sentences(metrics)))
        print("\n".join(metrics_lines(metrics)))
        print(alarm_sentence(alarm))
        if followed is not None:
            print("\n".join([*followed.lines, f"drawn: {options.adapt}"]))


def _check_recording(path: Path) -> None:
    """Raise RequestError for a push table, which has no streams to find windows in."""
    if path.name.endswith((".csv", ".csv.gz")):
        accepted = "a recording; `push_predictor evaluate MODEL TABLE` scores a model on a push table"
        raise RequestError("RECORDING", str(path), accepted)

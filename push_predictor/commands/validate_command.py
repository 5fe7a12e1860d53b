"""push_predictor validate: the offline counterpart of push_validator."""

from __future__ import annotations

import argparse
from pathlib import Path

from push_predictor.commands.output import add_command, add_rig, check_output, progress, warn, write_json


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """The sub-command `validate`."""
    parser = add_command(
        commands,
        "validate",
        "Compare a model's predictions with what a recording shows, window by window.",
        "push_predictor validate square_abs.pushmodel bags/square_abs_test --json validation.json",
    )
    parser.add_argument("model", type=Path, metavar="MODEL", help="a model file")
    parser.add_argument("recording", type=Path, metavar="RECORDING", help="a rosbag2 folder or an .mcap file")
    parser.add_argument("--false-alarm-rate", type=float, default=0.01, metavar="R", help="of the alarm (%(default)s)")
    parser.add_argument("--windows", type=Path, metavar="FILE.json", help="every window: predicted and observed")
    add_rig(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Validate and print; warn where the model is of another rig, or a push was trained on."""
    from push_predictor.evaluation.alarm.scores import recording_alarm
    from push_predictor.evaluation.metrics_text import metrics_lines
    from push_predictor.evaluation.offline import recording_rig, rig_difference, validate_recording
    from push_predictor.evaluation.validation import metrics_json, trained_on
    from push_predictor.models.store.model_file import load_model
    from push_predictor.online.window_log import write_window_log
    from push_predictor.recordings.rig import load_rig
    from push_predictor.recordings.windows.push_window import windows_to_table

    check_output("--windows", options.windows)
    model = load_model(options.model)
    rig = load_rig(options.rig) if options.rig else recording_rig(options.recording)
    with progress("validate"):
        windows, comparison = validate_recording(model, options.recording, rig, warn)
        alarm = recording_alarm(model, windows_to_table(windows), comparison, options.false_alarm_rate)
        metrics = {**metrics_json(comparison), "alarm": alarm}
    if difference := rig_difference(model, rig):
        warn(difference)
    if seen := trained_on(model, windows_to_table(windows)):
        warn(f"{len(seen)} of {metrics['n_pushes']} pushes were trained on ({seen[0]}, ...): not held out")
    if options.windows:
        write_window_log(options.windows, windows, comparison)
    if not write_json(options, metrics):
        print("\n".join(metrics_lines(metrics)))
        if alarm["fired"]:
            print(f"alarm at push {alarm['push_id']}, the {alarm['pushes']}th: {alarm['score']}")

"""push_predictor check: find mistakes in recordings and push tables before anything is learnt."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.commands.output import (
    add_command,
    add_rig,
    add_topics,
    check_data,
    progress,
    save_topics_of,
    topics_of,
    write_json,
)
from push_predictor.errors import RecordingError

if TYPE_CHECKING:
    from push_predictor.recordings.checks.finding import Finding
    from push_predictor.recordings.topics import Topics


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the sub-command `check`."""
    parser = add_command(
        commands,
        "check",
        "Find mistakes in recordings and push tables before training. Checks units, topics, frames, the outline, "
        "clocks and the wrench. Estimates the correction with its standard deviation.",
        "push_predictor check bags/square_abs_train",
    )
    parser.add_argument("data", nargs="+", type=Path, metavar="DATA", help="recordings or push tables")
    parser.add_argument("--strict", action="store_true", help="exit with status 1 after a warning too")
    add_rig(parser)
    add_topics(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Check the data and print the findings. Raises RecordingError that names what is refused."""
    check_data(options.data)
    with progress("check"):
        found = {str(path): _findings(path, options.rig, topics_of(options)) for path in options.data}
        save_topics_of(options, options.data)
    failing = ("refused", "warning") if options.strict else ("refused",)
    wrong = [f"{path}: {each.name}" for path, all_of in found.items() for each in all_of if each.severity in failing]
    content = {"sound": not wrong, "data": {path: [each.record() for each in all_of] for path, all_of in found.items()}}
    if not write_json(options, content):
        for path, findings in found.items():
            print(f"{path}: {len(findings) or 'no'} finding{'' if len(findings) == 1 else 's'}")
            for finding in findings:
                print("\n".join(finding.lines))
    if wrong:
        raise RecordingError(", ".join(wrong))


def _findings(path: Path, rig_file: Path | None, topics: Topics) -> tuple[Finding, ...]:
    from push_predictor.recordings.checks.check import check_recording, check_table
    from push_predictor.recordings.load import known_rig
    from push_predictor.recordings.read import read_recording, require_rig
    from push_predictor.recordings.rig import load_rig
    from push_predictor.recordings.table_file import is_recording, read_table

    given = load_rig(rig_file) if rig_file else None
    if not is_recording(path):
        return check_table(read_table(path), given or known_rig(path))
    recording = read_recording(path, rig=given, topics=topics)
    return check_recording(recording, require_rig(recording))

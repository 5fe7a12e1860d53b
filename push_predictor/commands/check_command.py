# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor check: find mistakes in recordings and push tables before anything is learnt."""

from __future__ import annotations

import argparse
from pathlib import Path

from push_predictor.commands.common.command import Output, command
from push_predictor.commands.common.options import READING, Reading, data_argument
from push_predictor.commands.common.output import write_json
from push_predictor.commands.common.progress import progress
from push_predictor.errors import RecordingError


@command(
    "check",
    "Find mistakes in recordings and push tables before training. Checks units, topics, frames, the outline, "
    "clocks and the wrench, and which sides, speeds and angles were pushed. Estimates each correction with its "
    "standard deviation.",
    "push_predictor check bags/square_abs_train",
    data_argument(),
    Output("--page", type=Path, metavar="FILE.html", help="write a page: tracks, contacts, coverage"),
    *READING,
)
def run(options: argparse.Namespace) -> None:
    """Check the data and print the findings. Raises RecordingError that names what is refused."""
    from push_predictor.evaluation.check_page import check_json, pushed, write_check_page
    from push_predictor.recordings.checks.check import checked_data
    from push_predictor.reporting import html

    if options.page is not None:
        html.check_installed("--page")
    reading = Reading(options)
    with progress("check"):
        checked = {str(path): checked_data(path, reading.rig, reading.topics) for path in options.data}
        reading.save_topics([path for path in options.data if not checked[str(path)].refused])
        if options.page is not None:
            write_check_page(options.page, checked)
    mistakes = [(path, each) for path, of in checked.items() for each in of.findings if each.severity != "note"]
    wrong = [f"{path}: {each.name}" for path, each in mistakes if options.strict or each.severity == "refused"]
    content = {
        "sound": not mistakes,
        "data": {path: [each.record() for each in of.findings] for path, of in checked.items()},
        "about": {path: check_json(of) for path, of in checked.items()},
    }
    if not write_json(options, content):
        for path, of in checked.items():
            print(f"{path}: {len(of.findings) or 'no'} finding{'' if len(of.findings) == 1 else 's'}. {pushed(of)}")
            for finding in of.findings:
                print("\n".join(finding.lines))
        if options.page is not None:
            print(f"page: {options.page}")
    if wrong:
        raise RecordingError(", ".join(wrong))

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The option --rig-out of `check`: the corrected rig of one recording."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.commands.common.output import check_output
from push_predictor.errors import RecordingError, RequestError

if TYPE_CHECKING:
    from push_predictor.recordings.checks.finding import Finding


def check_rig_out(options: argparse.Namespace) -> None:
    """Raise RequestError unless the file of --rig-out can be written and the data are one recording."""
    from push_predictor.recordings.table_file import is_recording

    if options.rig_out is None:
        return
    check_output("--rig-out", options.rig_out, force=options.force)
    if len(options.data) != 1 or not is_recording(options.data[0]):
        raise RequestError("--rig-out", str(options.rig_out), "it with one recording, not with tables or several data")


def write_corrected_rig(options: argparse.Namespace, found: Mapping[str, tuple[Finding, ...]]) -> None:
    """Write the rig that the findings correct, if --rig-out asks for it. Raises RecordingError where none can be."""
    from push_predictor.recordings.checks.outline.corrected_rig import corrected_rig, prevents_correction
    from push_predictor.recordings.load import known_rig
    from push_predictor.recordings.rig import load_rig, save_rig

    if options.rig_out is None:
        return
    path: Path = options.data[0]
    findings = found[str(path)]
    if names := prevents_correction(findings):
        raise RecordingError(f"{path}: no rig was written, correct this first: {', '.join(names)}")
    rig = load_rig(options.rig) if options.rig else known_rig(path)
    assert rig is not None, "the check has used it"
    save_rig(corrected_rig(rig, findings), options.rig_out)
    print(f"corrected rig: {options.rig_out}", file=sys.stderr)

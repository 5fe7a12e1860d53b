# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor import: convert recordings of other laboratories."""

from __future__ import annotations

import argparse
from pathlib import Path

from push_predictor.commands.common.command import Option, command
from push_predictor.commands.common.options import OUT_FOLDER, RIG, given_rig
from push_predictor.commands.common.output import check_folder, write_json
from push_predictor.commands.common.progress import progress

KINDS = ("mit", "mit-square", "mlab", "mcube", "rosbag1")


@command(
    "import",
    "Convert recordings of other laboratories. Reports what was dropped, repaired and assumed.",
    "push_predictor import mit-square pushes_3500.npz --out imported",
    Option("kind", choices=KINDS, metavar="KIND", help=f"format of the sources: {', '.join(KINDS)}"),
    Option("sources", nargs="+", type=Path, metavar="SOURCE", help="files or folders to convert"),
    OUT_FOLDER,
    RIG,
)
def run(options: argparse.Namespace) -> None:
    """Convert the sources and print a report."""
    from push_predictor.recordings.importers import import_source

    check_folder("--out", options.out, force=options.force)
    rig = given_rig(options)
    with progress(f"import {options.kind}") as watch:
        report = import_source(
            options.kind, options.sources, options.out, rig=rig, overwrite=options.force, watch=watch
        )
    if not write_json(options, report.to_json()):
        print(report)

"""push_predictor import: convert recordings of other laboratories."""

from __future__ import annotations

import argparse
from pathlib import Path

from push_predictor.commands.output import add_command, add_rig, check_output, progress, write_json

KINDS = ("mit", "mit-square", "mlab", "mcube", "rosbag1")


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the sub-command `import`."""
    parser = add_command(
        commands,
        "import",
        "Convert recordings of other laboratories. Reports what was dropped, repaired and assumed.",
        "push_predictor import mit-square pushes_3500.npz --out imported",
    )
    parser.add_argument("kind", choices=KINDS, metavar="KIND", help=f"format of the sources: {', '.join(KINDS)}")
    parser.add_argument("sources", nargs="+", type=Path, metavar="SOURCE", help="files or folders to convert")
    parser.add_argument("--out", required=True, type=Path, metavar="DIR", help="output folder")
    add_rig(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Convert the sources and print a report."""
    from push_predictor.recordings.importers import import_source
    from push_predictor.recordings.rig import load_rig

    check_output("--out", options.out, folder=True)
    rig = load_rig(options.rig) if options.rig else None
    with progress(f"import {options.kind}"):
        report = import_source(options.kind, options.sources, options.out, rig=rig)
    if not write_json(options, report.to_json()):
        print(report)

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor rig: write a rig file from the sizes of a shape, or corrected from a recording."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.commands.common.command import Group, Option, Output, command
from push_predictor.commands.common.options import RIG, TOPICS, Reading, out_option
from push_predictor.commands.common.output import check_data, write_json, write_text
from push_predictor.commands.common.progress import progress
from push_predictor.errors import RequestError, RigError

if TYPE_CHECKING:
    from push_predictor.recordings.checks.finding import Finding
    from push_predictor.recordings.rig import Rig

MEASURED = {
    "tip_radius": "the radius of the pusher's round tip in metres",
    "surface": "a name of the surface, for example plywood",
}
SHAPES = ("square", "rectangle", "circle", "ellipse", "polygon")
PICTURES = ".svg"


SHAPE = Group(
    "shape of the slider, seen from above, or a recording that corrects a rig",
    "The origin is the centroid. x and y are the axes of the tracked frame.",
    Option("--keep-origin", action="store_true", help="the file's origin is that of the tracked frame: do not move it"),
    Option("--name", help="name: of the shape; default: square, rectangle, ... or the name of the file"),
    one_of=(
        Option("--square", type=float, metavar="SIDE"),
        Option("--rectangle", type=float, nargs=2, metavar=("X", "Y"), help="sizes along x and along y"),
        Option("--circle", type=float, metavar="DIAMETER", help="the diameter, not the radius"),
        Option("--ellipse", type=float, nargs=2, metavar=("X", "Y"), help="full axes along x and along y"),
        Option(
            "--polygon",
            type=Path,
            metavar="FILE",
            help="vertices in order around the slider, in metres: CSV with the columns x,y, or a YAML or JSON list "
            "of [x, y]",
        ),
        Option(
            "--from",
            dest="recording",
            type=Path,
            metavar="RECORDING",
            help="correct outline or tip radius by at least 8 pushes; the rig to correct is that of --rig, or recorded",
        ),
    ),
)
MEASUREMENTS = Group(
    "what else was measured",
    None,
    Option("--tip-radius", type=float, metavar="R", help="radius of the pusher's round tip, m"),
    Option("--surface", metavar="NAME", help="name of the surface"),
    Option("--mass", type=float, metavar="KG", help="mass of the slider, kg, if it is known"),
    Option("--contact-friction", type=float, metavar="MU", help="pusher on slider, if it is known"),
    Option("--surface-friction", type=float, metavar="MU", help="slider on surface, if it is known"),
    Option(
        "--support-point",
        type=float,
        nargs=3,
        action="append",
        metavar=("X", "Y", "SHARE"),
        help="a foot of the slider, m, and its share of the load, if known; may be repeated",
    ),
)


@command(
    "rig",
    "Write a rig file from the sizes of a shape. The sizes are those that a caliper measures, in metres: "
    "sides, diameters, full axes. With --from, the contacts of a recording correct yaw, place, size or tip radius.",
    "push_predictor rig --square 0.09 --tip-radius 0.00475 --surface plywood --out rig.yaml",
    SHAPE,
    MEASUREMENTS,
    RIG,
    TOPICS,
    out_option("the rig file, FILE.yaml"),
    Output("--picture", type=Path, metavar="FILE.svg", help="draw outline, axes and tip to scale"),
)
def run(options: argparse.Namespace) -> None:
    """Write the rig file. Raises RequestError or RigError that names the option or file."""
    from push_predictor.recordings.new_rig import rig_lines
    from push_predictor.recordings.rig import save_rig
    from push_predictor.reporting.rig_picture import rig_svg

    if options.picture is not None and options.picture.suffix != PICTURES:
        raise RequestError("--picture", str(options.picture), f"a file that ends with {PICTURES}")
    shape = next((name for name in SHAPES if getattr(options, name) is not None), None)
    _check_call(options, shape)
    rig, notes, findings = _corrected(options) if shape is None else _measured(options, shape)
    save_rig(rig, options.out)
    if options.picture is not None:
        write_text(options.picture, rig_svg(rig))
    content: dict[str, object] = {"rig": str(options.out), "notes": list(notes), "record": rig.to_record()}
    if shape is None:
        content["findings"] = [finding.record() for finding in findings]
    if not write_json(options, content):
        print("\n".join([f"{options.out}: {rig.shape} on {rig.surface}", *rig_lines(rig)]))
        if options.picture is not None:
            print(f"picture: {options.picture}")
        for note in notes:
            print(f"note: {note}")
        for finding in findings:
            print("\n".join(finding.lines))


def _check_call(options: argparse.Namespace, shape: str | None) -> None:
    """Raise RequestError for options that are missing, or that nothing would use."""
    if shape is not None and options.rig is not None:
        raise RequestError("--rig", str(options.rig), "it only with --from RECORDING")
    if options.keep_origin and shape != "polygon":
        raise RequestError("--keep-origin", True, "it only with --polygon")
    for name in (*MEASURED, "mass", "name", "contact_friction", "surface_friction", "support_point"):
        given, option = getattr(options, name), f"--{name.replace('_', '-')}"
        if shape is None and given is not None:
            raise RequestError(option, given, "it only with a shape")
        if shape is not None and given is None and name in MEASURED:
            raise RequestError(option, None, MEASURED[name])


def _corrected(options: argparse.Namespace) -> tuple[Rig, tuple[str, ...], tuple[Finding, ...]]:
    """The rig corrected by the findings of `check` about the recording, no notes, and these findings."""
    from push_predictor.recordings.checks.check import check_recording
    from push_predictor.recordings.checks.geometry import corrected_rig
    from push_predictor.recordings.read import read_recording, require_rig

    check_data([options.recording])
    with progress("rig"):
        reading = Reading(options)
        recording = read_recording(options.recording, rig=reading.rig, topics=reading.topics)
        rig = require_rig(recording)
        findings = check_recording(recording, rig)
        try:
            rig = corrected_rig(rig, findings)
        except RigError as error:
            raise RigError(f"{options.recording}: {error}") from None
        reading.save_topics([options.recording])
    return rig, (), findings


def _measured(options: argparse.Namespace, shape: str) -> tuple[Rig, tuple[str, ...], tuple[Finding, ...]]:
    """The rig of the given sizes, notes on what was changed, and no findings."""
    import numpy as np

    from push_predictor.geometry.shapes import ellipse, rectangle
    from push_predictor.recordings.new_rig import length_of, new_rig, read_polygon

    moved, name, given = np.zeros(2), shape, getattr(options, shape)
    notes: tuple[str, ...] = ()
    if shape == "polygon":
        polygon = read_polygon(given, options.keep_origin)
        outline, moved, notes, name = polygon.outline, polygon.moved, polygon.notes, given.stem
    else:
        sizes = [length_of(f"--{shape}", size) for size in (given if isinstance(given, list) else [given, given])]
        outline = ellipse(sizes[0] / 2.0, sizes[1] / 2.0) if shape in ("circle", "ellipse") else rectangle(*sizes)
    points = None if options.support_point is None else np.array(options.support_point) + [*moved, 0.0]
    measured = (options.tip_radius, options.surface, options.mass)
    frictions = (options.contact_friction, options.surface_friction)
    return new_rig(options.name or name, outline, *measured, points, *frictions), notes, ()

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Options that several commands share (--json, --out, --rig, topics, covariates) and what they mean."""

from __future__ import annotations

import argparse
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.commands.common.output import warn
from push_predictor.errors import RequestError

if TYPE_CHECKING:
    from push_predictor.recordings.rig import Rig
    from push_predictor.recordings.topics import Topics

SIGNED_AXES = ("-x", "-y", "-z")
HELP_WIDTH = 100  # characters


def add_command(
    commands: argparse._SubParsersAction[argparse.ArgumentParser], name: str, summary: str, example: str
) -> argparse.ArgumentParser:
    """Return a sub-parser with --json, --force and an example.

    The first sentence of the summary is its line in the overview.
    """
    parser = commands.add_parser(
        name,
        help=summary.partition(". ")[0].removesuffix("."),
        description=textwrap.fill(summary, HELP_WIDTH),
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,  # a later option must not change what an abbreviation in a script means
    )
    parser.add_argument("--json", metavar="FILE|-", help="write the result as JSON to this file, or to stdout (-)")
    parser.add_argument("--force", action="store_true", help="overwrite existing output files")
    return parser


def add_model(parser: argparse.ArgumentParser, nargs: str | None = None, *, note: str = "") -> None:
    """Add the argument MODEL. note: what it is, where it may be absent or several may be given."""
    parser.add_argument(
        "model", type=Path, nargs=nargs, metavar="MODEL", help=f"a model file, or default: the shipped one{note}"
    )


def add_data(parser: argparse.ArgumentParser) -> None:
    """Add the argument DATA, one or several."""
    parser.add_argument("data", nargs="+", type=Path, metavar="DATA", help="recordings or push tables")


def add_out(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the required option --out; what: a noun phrase for the file or folder that is written."""
    parser.add_argument("--out", required=True, type=Path, metavar="PATH", help=f"output: {what}")


def add_seed(parser: argparse.ArgumentParser, of: str) -> None:
    """Add the option --seed; of: what it makes random."""
    meaning = f"random seed: of {of} (default %(default)s)"
    parser.add_argument("--seed", type=int, default=0, metavar="K", help=meaning)


def add_travel(parser: argparse.ArgumentParser) -> None:
    """Add the option --travel."""
    meaning = "length of each push in m (default %(default)s)"
    parser.add_argument("--travel", type=float, default=0.03, metavar="D", help=meaning)


def add_rig(parser: argparse.ArgumentParser) -> None:
    """Add the option --rig."""
    parser.add_argument(
        "--rig", type=Path, metavar="FILE.yaml", help="rig file, needed if the data contain no push_rig record"
    )


def given_rig(options: argparse.Namespace) -> Rig | None:
    """The rig of --rig, None without the option. Raises RigError."""
    from push_predictor.recordings.rig import load_rig

    return load_rig(options.rig) if options.rig else None


def add_topics(parser: argparse.ArgumentParser, saves: bool = False) -> None:
    """Add the options that name the topics of recordings; `topics_of` reads them.

    saves: the command saves the topics in any case, so that it needs no option for that.
    """
    group = parser.add_argument_group(
        "topics of recordings",
        "TOPIC is a name, TOPIC.FIELD a field of another type, /tf:FRAME a frame.\nWhat is not given is read from "
        "NAME.recording.yaml next to the recording.",
    )
    wrench = "pusher/wrench, if there is one; none leaves a recorded wrench out"
    for name, default in (("slider", "slider/pose"), ("pusher", "pusher/pose"), ("wrench", wrench)):
        group.add_argument(f"--{name}-topic", default="", metavar="TOPIC", help=f"default: {default}")
    group.add_argument(
        "--covariate-topic",
        dest="covariate_topics",
        action="append",
        default=[],
        metavar="TOPIC",
        help="a further covariate: TOPIC or TOPIC.FIELD; may be repeated. Topics of scalar types need no option",
    )
    group.add_argument(
        "--wrench-frame",
        default="",
        metavar="world|tip|FRAME",
        help="axes of the wrench: the world's (default), turned with the tip's pose, or of a frame in /tf",
    )
    group.add_argument(
        "--wrench-bias",
        default="",
        choices=("free_motion", "none"),
        help="subtract bias and weight of the sensor, estimated while the tip touches nothing; default: none",
    )
    group.add_argument(
        "--world-frame",
        default="",
        metavar="FRAME",
        help="frame of all poses: tf turns poses of other frames into it. Default: frames in /tf are looked up in "
        "world or the root, other poses keep their frame",
    )
    group.add_argument(
        "--stamp",
        default="",
        choices=("header", "log"),
        help="time of each sample: of its header (default), or at which the recorder received it, for all streams",
    )
    group.add_argument(
        "--up",
        default="",
        metavar="AXIS|STREAM=AXIS",
        help="axis of the poses' world that points up: x, y, z (default), -x, -y or -z. Of single streams: slider=y",
    )
    if not saves:
        group.add_argument("--save-topics", action="store_true", help="save these options in NAME.recording.yaml")


def with_signed_axes(words: Sequence[str]) -> list[str]:
    """The words of a call with `--up -z` as `--up=-z`: the parser takes `-z` for an option."""
    found: list[str] = []
    for word in words:
        if found[-1:] == ["--up"] and word in SIGNED_AXES:
            found[-1] = f"--up={word}"
        else:
            found.append(word)
    return found


def topics_of(options: argparse.Namespace) -> Topics:
    """The topics given on the command line. Raises RequestError for an empty name."""
    from push_predictor.recordings import topics

    values = vars(options)
    for key in ("slider_topic", "pusher_topic", "wrench_topic", "covariate_topics"):
        for text in [values[key]] if isinstance(values[key], str) else values[key]:
            if text and not text.partition(":")[0].partition(".")[0].strip("/ "):
                option = f"--{key.removesuffix('s').replace('_', '-')}"
                raise RequestError(option, text, "TOPIC, TOPIC.FIELD or /tf:FRAME")
    return topics.topics_of(values)


def save_topics_of(options: argparse.Namespace, paths: Sequence[Path]) -> None:
    """Save the topics next to the recordings among the paths, if --save-topics asks for it; call it once all are read.

    Topics that were saved before and are not given stay. Raises OSError that names the path.
    """
    from push_predictor.recordings.table_file import is_recording
    from push_predictor.recordings.topics import load_topics, save_topics

    for path in (path for path in paths if options.save_topics and is_recording(path)):
        saved = save_topics(path, topics_of(options).over(load_topics(path)))
        print(f"topics: {saved}", file=sys.stderr)


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Add the options of commands that judge the data which they read: --strict, --rig and the topics."""
    parser.add_argument(
        "--strict", action="store_true", help="exit with status 1 after a warning about the data too (see `check`)"
    )
    add_rig(parser)
    add_topics(parser)


class Reading:
    """How a command reads data, by the options of `add_reading`: rig (None without --rig), topics, and the checks.

    Raises RigError, and RequestError for an empty topic.
    """

    def __init__(self, options: argparse.Namespace) -> None:
        from push_predictor.recordings.checks.check import DataChecks

        self.rig, self.topics = given_rig(options), topics_of(options)
        self.checks = DataChecks(options.strict, warn)
        self._options = options

    def save_topics(self, paths: Sequence[Path]) -> None:
        """Save the topics next to the recordings, if asked; see `save_topics_of`."""
        save_topics_of(self._options, paths)


def add_covariate(parser: argparse.ArgumentParser) -> None:
    """Add the option --covariate; `covariates_of` reads it."""
    meaning = "a covariate that an extended model needs; may be repeated"
    parser.add_argument("--covariate", action="append", default=[], metavar="NAME=VALUE", help=meaning)


def covariates_of(options: argparse.Namespace) -> dict[str, float]:
    """The covariates by name. Raises RequestError for a text that is not NAME=VALUE."""
    return dict(_covariate(text) for text in options.covariate)


def _covariate(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        number = None
    if not name or number is None:
        raise RequestError("--covariate", text, "NAME=VALUE, where VALUE is a number")
    return name, number

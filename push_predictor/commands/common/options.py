# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Options that several commands share (--out, --rig, topics, covariates) and what they mean."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from push_predictor.commands.common.command import Group, Option, Output
from push_predictor.commands.common.output import check_data, warn
from push_predictor.errors import RequestError
from push_predictor.recordings import topic_settings
from push_predictor.recordings.topic_settings import Setting

if TYPE_CHECKING:
    from push_predictor.recordings.checks.check import DataChecks
    from push_predictor.recordings.rig import Rig
    from push_predictor.recordings.topics import Topics

SIGNED_AXES = ("-x", "-y", "-z")


def model_argument(nargs: str | None = None, note: str = "") -> Option:
    """The argument MODEL. note: what it is, where it may be absent or several may be given."""
    return Option(
        "model", type=Path, nargs=nargs, metavar="MODEL", help=f"a model file, or default: the shipped one{note}"
    )


def data_argument(nargs: str = "+", note: str = "") -> Option:
    """The argument DATA, several recordings or push tables."""

    def check(options: argparse.Namespace) -> None:
        check_data(options.data)

    meaning = f"recordings or push tables{note}"
    return Option("data", check=check, nargs=nargs, type=Path, metavar="DATA", help=meaning)


def out_option(what: str, is_folder: Callable[[Path], bool] = lambda path: False) -> Output:
    """The required option --out for a file, or where `is_folder` a folder; what: a noun phrase for it."""
    return Output("--out", is_folder, required=True, type=Path, metavar="PATH", help=f"output: {what}")


def seed_option(of: str) -> Option:
    """The option --seed; of: what it makes random."""

    def check(options: argparse.Namespace) -> None:
        if options.seed < 0:
            raise RequestError("--seed", options.seed, "an integer of at least 0")

    meaning = f"random seed: of {of} (default %(default)s)"
    return Option("--seed", check=check, type=int, default=0, metavar="K", help=meaning)


OUT_FOLDER = Option("--out", required=True, type=Path, metavar="PATH", help="output: a folder")  # see check_folder
TRAVEL = Option(
    "--travel", type=float, default=0.03, metavar="D", help="length of each push in m (default %(default)s)"
)
COVARIATE = Option(
    "--covariate",
    action="append",
    default=[],
    metavar="NAME=VALUE",
    help="a covariate that an extended model needs; may be repeated",
)
RIG = Option("--rig", type=Path, metavar="FILE.yaml", help="rig file, needed if the data contain no push_rig record")


def _setting(setting: Setting, note: str = "", **more: Any) -> Option:
    """The option of a setting of the topics."""
    meaning = setting.meaning[0].lower() + setting.meaning[1:]
    text = f"{meaning}. Default: {setting.default}{note}"
    return Option(f"--{setting.name.replace('_', '-')}", default="", help=text, **more)


_SLIDER, _PUSHER, _WRENCH = topic_settings.TOPICS
_TOPICS = (
    _setting(_SLIDER, metavar="TOPIC"),
    _setting(_PUSHER, metavar="TOPIC"),
    _setting(_WRENCH, ", if there is one; none leaves a recorded wrench out", metavar="TOPIC"),
    Option(
        "--covariate-topic",
        dest="covariate_topics",
        action="append",
        default=[],
        metavar="TOPIC",
        help="a further covariate: TOPIC or TOPIC.FIELD; may be repeated. Topics of scalar types need no option",
    ),
    _setting(topic_settings.WRENCH_FRAME, metavar="world|tip|FRAME"),
    _setting(topic_settings.WRENCH_BIAS, choices=("free_motion", "none")),
    _setting(topic_settings.WORLD_FRAME, "; of frames in /tf world, or the root", metavar="FRAME"),
    _setting(topic_settings.STAMP, choices=("header", "log")),
    _setting(topic_settings.UP, metavar="AXIS|STREAM=AXIS"),
)
_ABOUT_TOPICS = (
    "topics of recordings",
    "TOPIC is a name, TOPIC.FIELD a field of another type, /tf:FRAME a frame.\nWhat is not given is read from "
    "NAME.recording.yaml next to the recording.",
)
SAVED_TOPICS = Group(*_ABOUT_TOPICS, *_TOPICS)  # of the command that saves them in any case
TOPICS = Group(
    *_ABOUT_TOPICS,
    *_TOPICS,
    Option("--save-topics", action="store_true", help="save these options in NAME.recording.yaml"),
)
READING = (  # of the commands that judge the data which they read
    Option("--strict", action="store_true", help="exit with status 1 after a warning about the data too (see `check`)"),
    RIG,
    TOPICS,
)


class Reading:
    """How a command reads data, by RIG, TOPICS and, if it has them, READING.

    rig: None without --rig. checks: of the data. Raises RigError, and RequestError for an empty topic.
    """

    def __init__(self, options: argparse.Namespace) -> None:
        self.rig, self.topics = given_rig(options), topics_of(options)
        self._strict: bool = getattr(options, "strict", False)
        self._saves: bool = options.save_topics

    @cached_property
    def checks(self) -> DataChecks:
        """See the class."""
        from push_predictor.recordings.checks.check import DataChecks

        return DataChecks(self._strict, warn)

    def save_topics(self, paths: Sequence[Path]) -> None:
        """Save the topics next to the recordings among the paths, if --save-topics asks for it, once all are read.

        Topics that were saved before and are not given stay. Raises OSError that names the path.
        """
        from push_predictor.recordings.table_file import is_recording
        from push_predictor.recordings.topics import load_topics, save_topics

        for path in (path for path in paths if self._saves and is_recording(path)):
            saved = save_topics(path, self.topics.over(load_topics(path)))
            print(f"topics: {saved}", file=sys.stderr)


def given_rig(options: argparse.Namespace) -> Rig | None:
    """The rig of --rig, None without the option. Raises RigError."""
    from push_predictor.recordings.rig import load_rig

    return load_rig(options.rig) if options.rig else None


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


def with_signed_axes(words: Sequence[str]) -> list[str]:
    """The words of a call with `--up -z` as `--up=-z`: the parser takes `-z` for an option."""
    found: list[str] = []
    for word in words:
        if found[-1:] == ["--up"] and word in SIGNED_AXES:
            found[-1] = f"--up={word}"
        else:
            found.append(word)
    return found


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

"""What all commands share: options such as --json, --rig and topics, checks of paths, warnings, progress messages."""

from __future__ import annotations

import argparse
import json
import os
import sys
import textwrap
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.errors import RecordingError, RequestError
from push_predictor.recordings.atomic import write_whole

if TYPE_CHECKING:
    from push_predictor.recordings.topics import Topics

PATIENCE = 2.0  # s before the first progress message, and between messages

HELP_WIDTH = 100  # characters


def add_command(
    commands: argparse._SubParsersAction[argparse.ArgumentParser], name: str, summary: str, example: str
) -> argparse.ArgumentParser:
    """Return a sub-parser with --json and an example. The first sentence of the summary is its line in the overview."""
    parser = commands.add_parser(
        name,
        help=summary.partition(". ")[0].removesuffix("."),
        description=textwrap.fill(summary, HELP_WIDTH),
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--json", metavar="FILE|-", help="write the result as JSON to this file, or to stdout (-)")
    return parser


def add_rig(parser: argparse.ArgumentParser) -> None:
    """Add the option --rig."""
    parser.add_argument(
        "--rig", type=Path, metavar="FILE.yaml", help="rig file, needed if the data contain no push_rig record"
    )


def add_topics(parser: argparse.ArgumentParser) -> None:
    """Add the options that name the topics of recordings; `topics_of` reads them."""
    group = parser.add_argument_group(
        "topics of recordings",
        "TOPIC is a name, TOPIC.FIELD a field of another type, /tf:FRAME a frame.\nWhat is not given is read from "
        "NAME.recording.yaml next to the recording.",
    )
    for name, default in (("slider", "slider/pose"), ("pusher", "pusher/pose"), ("wrench", "pusher/wrench")):
        group.add_argument(f"--{name}-topic", default="", metavar="TOPIC", help=f"default: {default}")
    group.add_argument(
        "--covariate-topic",
        action="append",
        default=[],
        metavar="TOPIC",
        help="a further covariate: TOPIC or TOPIC.FIELD; may be repeated. Topics of scalar types need no option",
    )
    group.add_argument("--save-topics", action="store_true", help="save these options in NAME.recording.yaml")


def topics_of(options: argparse.Namespace) -> Topics:
    """The topics given on the command line. Raises RequestError for an empty name."""
    from push_predictor.recordings.topics import Topics

    for option in ("slider_topic", "pusher_topic", "wrench_topic", "covariate_topic"):
        given = getattr(options, option)
        for text in [given] if isinstance(given, str) else given:
            if text and not text.partition(":")[0].partition(".")[0].strip("/ "):
                raise RequestError(f"--{option.replace('_', '-')}", text, "TOPIC, TOPIC.FIELD or /tf:FRAME")
    return Topics(options.slider_topic, options.pusher_topic, options.wrench_topic, tuple(options.covariate_topic))


def save_topics_of(options: argparse.Namespace, paths: Sequence[Path]) -> None:
    """Save the topics next to the recordings among the paths, if --save-topics asks for it; call it once all are read.

    Topics that were saved before and are not given stay. Raises OSError that names the path.
    """
    from push_predictor.recordings.table_file import is_recording
    from push_predictor.recordings.topics import load_topics, save_topics

    for path in (path for path in paths if options.save_topics and is_recording(path)):
        saved = save_topics(path, topics_of(options).over(load_topics(path)))
        print(f"topics: {saved}", file=sys.stderr)


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


def write_json(options: argparse.Namespace, result: Mapping[str, object]) -> bool:
    """Write the result as JSON if asked; return True if it went to stdout, which then takes nothing else."""
    if options.json is None:
        return False
    text = json.dumps(result, indent=2, allow_nan=False)
    if options.json == "-":
        print(text)
        return True
    write_text(Path(options.json), text + "\n")
    return False


def write_text(path: Path, text: str) -> None:
    """Write a file; an older one is replaced only by a complete new one. Raises OSError that names the path."""
    write_whole(path, text.encode())


def warn(text: str) -> None:
    """Print a warning on stderr."""
    print(f"warning: {text}", file=sys.stderr)


def check_output(option: str, path: Path | None, *, folder: bool = False) -> None:
    """Raise RequestError unless a file (or a folder) can be written there. Missing folders are created later.

    Called before the work, so that hours of it are not lost at the end.
    """
    if path is None:
        return
    if path.exists() and path.is_dir() != folder:
        accepted = "a folder: this is a file" if folder else "the path of a file: this is a folder"
        raise RequestError(option, str(path), accepted)
    places = [path.absolute(), *path.absolute().parents] if folder else path.absolute().parents
    place = next(place for place in places if place.exists())
    if not place.is_dir():
        raise RequestError(option, str(path), f"a path inside a folder: {place} is a file")
    if not os.access(place, os.W_OK | os.X_OK):
        raise RequestError(option, str(path), f"a path in a folder with write permission: {place} has none")


def check_json(options: argparse.Namespace) -> None:
    """Raise RequestError unless the file of --json can be written."""
    if options.json not in (None, "-"):
        check_output("--json", Path(options.json))


def check_data(paths: Sequence[Path]) -> None:
    """Raise RecordingError for a path that does not exist or is neither a recording nor a push table."""
    from push_predictor.recordings.table_file import ENDINGS, is_recording

    for path in paths:
        if not path.exists():
            raise RecordingError(f"{path}: no such file or folder")
        if not (is_recording(path) or path.name.endswith(ENDINGS)):
            accepted = "a recording (a folder, .mcap, .db3 or .bag) or a push table (.csv or .csv.gz)"
            raise RecordingError(f"{path}: give {accepted}")


def check_seed(seed: int) -> None:
    """Raise RequestError for a negative seed."""
    if seed < 0:
        raise RequestError("--seed", seed, "an integer of at least 0")


@contextmanager
def progress(task: str) -> Iterator[None]:
    """Print the task and the elapsed time on stderr every two seconds while it runs."""
    done, start = threading.Event(), time.monotonic()

    def report() -> None:
        while not done.wait(PATIENCE):
            print(f"{task}: {time.monotonic() - start:.0f} s", file=sys.stderr, flush=True)

    reporter = threading.Thread(target=report, daemon=True)
    reporter.start()
    try:
        yield
    finally:
        done.set()
        reporter.join()

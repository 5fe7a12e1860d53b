"""What every command shares: --json, --rig, and word of progress when work takes long."""

from __future__ import annotations

import argparse
import json
import os
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from push_predictor.errors import RecordingError, RequestError
from push_predictor.recordings.atomic import write_whole

PATIENCE = 2.0  # s before the first word, and between words


def add_command(
    commands: argparse._SubParsersAction[argparse.ArgumentParser], name: str, summary: str, example: str
) -> argparse.ArgumentParser:
    """A sub-parser with --json and an example at the end of its help."""
    parser = commands.add_parser(
        name,
        help=summary,
        description=summary,
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--json", metavar="FILE|-", help="write the result as JSON to a file, or to stdout with -")
    return parser


def add_rig(parser: argparse.ArgumentParser) -> None:
    """The option --rig."""
    parser.add_argument("--rig", type=Path, metavar="FILE.yaml", help="the push_rig record, where the data hold none")


def write_json(options: argparse.Namespace, result: Mapping[str, object]) -> bool:
    """Write the result where --json says; True if it went to stdout, so that nothing else should."""
    if options.json is None:
        return False
    text = json.dumps(result, indent=2, allow_nan=False)
    if options.json == "-":
        print(text)
        return True
    write_text(Path(options.json), text + "\n")
    return False


def write_text(path: Path, text: str) -> None:
    """Write a file; an older one is replaced when the new one is complete. Raises OSError that names the path."""
    write_whole(path, text.encode())


def warn(text: str) -> None:
    """Say something on stderr that does not stop the work."""
    print(f"warning: {text}", file=sys.stderr)


def check_output(option: str, path: Path | None, *, folder: bool = False) -> None:
    """Raise RequestError unless a file (or a folder with its files) can be written there: before the work, not after.

    Folders that are not there will be made.
    """
    if path is None:
        return
    if path.exists() and path.is_dir() != folder:
        accepted = "a folder, this is a file" if folder else "the path of a file, this is a folder"
        raise RequestError(option, str(path), accepted)
    places = [path.absolute(), *path.absolute().parents] if folder else path.absolute().parents
    place = next(place for place in places if place.exists())
    if not place.is_dir():
        raise RequestError(option, str(path), f"a path in a folder, {place} is none")
    if not os.access(place, os.W_OK | os.X_OK):
        raise RequestError(option, str(path), f"a path in a folder that may be written to, {place} may not")


def check_json(options: argparse.Namespace) -> None:
    """The same for --json."""
    if options.json not in (None, "-"):
        check_output("--json", Path(options.json))


def check_data(paths: Sequence[Path]) -> None:
    """Raise RecordingError for a path that is not there, or that can be neither recording nor table."""
    for path in paths:
        if not path.exists():
            raise RecordingError(f"{path}: no such file or folder")
        if not (path.is_dir() or path.name.endswith((".mcap", ".csv", ".csv.gz"))):
            raise RecordingError(f"{path}: give a recording (a folder or .mcap) or a push table (.csv or .csv.gz)")


def check_seed(seed: int) -> None:
    """Raise RequestError for a seed that no generator takes."""
    if seed < 0:
        raise RequestError("--seed", seed, "an integer from 0 on")


@contextmanager
def progress(doing: str) -> Iterator[None]:
    """Say on stderr what is being done and for how long, once it takes more than two seconds."""
    done, begun = threading.Event(), time.monotonic()

    def speak() -> None:
        while not done.wait(PATIENCE):
            print(f"{doing}: {time.monotonic() - begun:.0f} s", file=sys.stderr, flush=True)

    speaker = threading.Thread(target=speak, daemon=True)
    speaker.start()
    try:
        yield
    finally:
        done.set()
        speaker.join()

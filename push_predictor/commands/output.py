"""What every command shares: --json, --rig, and word of progress when work takes long."""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

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
    path = Path(options.json)
    temporary = path.with_name(f".{path.name}.part")
    temporary.write_text(text + "\n")
    temporary.replace(path)
    return False


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

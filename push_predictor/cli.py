# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# PYTHON_ARGCOMPLETE_OK
"""The command line `push_predictor`. Each sub-command is a module in push_predictor.commands.

Exit status 0: done; 1: the work failed, and one line on stderr states why; 2: the call was wrong. A failure that nobody
foresaw is one line as well; with PUSH_PREDICTOR_TRACEBACK=1 its traceback comes before it.
"""

from __future__ import annotations

import argparse
import os
import sys
import traceback
from collections.abc import Sequence
from importlib import import_module

from push_predictor import __version__
from push_predictor.blas_threads import limit_process
from push_predictor.commands.common.options import with_signed_axes
from push_predictor.errors import PushPredictorError

LONGEST_FAULT = 500  # characters of an error's text
TRACEBACK = "PUSH_PREDICTOR_TRACEBACK"  # environment variable: print where an unforeseen failure happened
COMMANDS = (
    "import",
    "record",
    "simulate",
    "train",
    "predict",
    "suggest",
    "evaluate",
    "validate",
    "trace",
    "report",
    "rig",
    "check",
    "info",
    "doctor",
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one sub-command and return its exit status."""
    # With a thousand rows a second thread gains little, and it is ten times slower if another process needs the core.
    limit_process()
    completing = "_ARGCOMPLETE" in os.environ  # set by the shell: argcomplete takes longer than the parser
    words = with_signed_axes(sys.argv[1:] if arguments is None else arguments)
    parser = build_parser(words[:1] if words and words[0] in COMMANDS and not completing else COMMANDS)
    if completing:
        _complete(parser)
    options = parser.parse_args(words)
    try:
        options.run(options)
        sys.stdout.flush()  # report a full disk here, not when the interpreter exits
    except BrokenPipeError:  # the reader closed the pipe, as `| head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (PushPredictorError, OSError) as error:
        print(f"push_predictor {options.command}: {_one_line(error)}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"push_predictor {options.command}: interrupted", file=sys.stderr)
        return 130
    except Exception as error:  # a user can do nothing with a traceback, the authors can
        if os.environ.get(TRACEBACK):
            traceback.print_exc()
        print(f"push_predictor {options.command}: {_fault(error)}", file=sys.stderr)
        return 1
    return 0


def build_parser(names: Sequence[str] = COMMANDS) -> argparse.ArgumentParser:
    """Return the parser with these sub-commands; a call needs its own only, and the others take time to import."""
    parser = argparse.ArgumentParser(
        prog="push_predictor",
        description="Learn models of planar pushing from recordings, check them, and explain their errors.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"push_predictor {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name in names:
        import_module(f"push_predictor.commands.{name}_command").run.add_to(commands)
    return parser


def _complete(parser: argparse.ArgumentParser) -> None:
    """Print the completions of the shell's line and end, if argcomplete is installed."""
    try:
        import argcomplete
    except ImportError:
        return
    argcomplete.autocomplete(parser)


def _fault(error: Exception) -> str:
    """What failed, where, and how to see more."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    what = " ".join(f"{type(error).__name__}: {error}".split()).removesuffix(":")[:LONGEST_FAULT]
    return (
        f"{what} ({os.path.basename(place.filename)} line {place.lineno}). This is a fault of the program, not of the "
        f"call. {TRACEBACK}=1 shows the traceback; please report it."
    )


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename2 or error.filename}: {error.strerror}"  # filename2 is the destination
    return " ".join(str(error).split())


if __name__ == "__main__":
    sys.exit(main())

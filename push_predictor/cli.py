"""The command line `push_predictor`: one module a sub-command, in push_predictor.commands.

Exit status 0: done; 1: the work failed, one line on stderr says why; 2: the call was wrong.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module

from push_predictor import __version__
from push_predictor.commands.output import check_json
from push_predictor.errors import PushPredictorError

COMMANDS = ("import", "simulate", "train", "predict", "evaluate", "validate", "trace", "report", "info", "doctor")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one sub-command and return the exit status."""
    # A second thread gains little for a thousand rows, and costs tenfold where another process wants the core.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    options = build_parser().parse_args(arguments)
    try:
        check_json(options)
        options.run(options)
        sys.stdout.flush()  # a full disk behind a pipe is told now, not when the interpreter ends
    except BrokenPipeError:  # the reader of our output has gone, `| head` for instance
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (PushPredictorError, OSError) as error:
        print(f"push_predictor {options.command}: {_one_line(error)}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"push_predictor {options.command}: interrupted", file=sys.stderr)
        return 130
    return 0


def build_parser() -> argparse.ArgumentParser:
    """The parser with all sub-commands."""
    parser = argparse.ArgumentParser(prog="push_predictor", description="Models of planar pushing, from recordings.")
    parser.add_argument("--version", action="version", version=f"push_predictor {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name in COMMANDS:
        import_module(f"push_predictor.commands.{name}_command").add_parser(commands)
    return parser


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename2 or error.filename}: {error.strerror}"  # the second one is where it should have gone
    return " ".join(str(error).split())


if __name__ == "__main__":
    sys.exit(main())

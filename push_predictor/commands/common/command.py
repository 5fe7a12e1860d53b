# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How a command is declared: what it is called, its options, and what is checked before its work."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from push_predictor.commands.common.output import check_output

HELP_WIDTH = 100  # characters
Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
Check: TypeAlias = Callable[[argparse.Namespace], None]


class Option:
    """An option or argument; flags and settings are those of `add_argument`.

    check: raises PushPredictorError for values that the work would refuse.
    """

    def __init__(self, *flags: str, check: Check = lambda options: None, **settings: Any) -> None:
        self._flags, self._settings, self.check = flags, settings, check

    def add_to(self, parser: argparse._ActionsContainer) -> None:
        """Add it to a parser or group."""
        parser.add_argument(*self._flags, **self._settings)


class Output(Option):
    """An option for a file that is written. An older one is refused before the work, unless --force is given.

    is_folder: whether a folder is written to the path.
    """

    def __init__(self, flag: str, is_folder: Callable[[Path], bool] = lambda path: False, **settings: Any) -> None:
        def check(options: argparse.Namespace) -> None:
            path = getattr(options, flag.strip("-").replace("-", "_"))
            if path not in (None, "-"):
                check_output(flag, Path(path), force=options.force, folder=is_folder(Path(path)))

        super().__init__(flag, check=check, **settings)


class Group:
    """Options under a title. one_of: of these exactly one is required."""

    def __init__(self, title: str, description: str | None, *options: Option, one_of: Sequence[Option] = ()) -> None:
        self._title, self._description, self._options, self._one_of = title, description, options, one_of

    def add_to(self, parser: argparse.ArgumentParser) -> None:
        """Add them to a parser."""
        group = parser.add_argument_group(self._title, self._description)
        one = group.add_mutually_exclusive_group(required=True) if self._one_of else group
        for option in self._one_of:
            option.add_to(one)
        for option in self._options:
            option.add_to(group)

    def check(self, options: argparse.Namespace) -> None:
        """Check the values."""
        for option in (*self._one_of, *self._options):
            option.check(options)


COMMON = (
    Output("--json", metavar="FILE|-", help="write the result as JSON to this file, or to stdout (-)"),
    Option("--force", action="store_true", help="overwrite existing output files"),
)


@dataclass(frozen=True)
class Command:
    """A command. The first sentence of its summary is its line in the overview.

    wrong_call: why options do not belong together, '' if they do; asked before values are checked. work: called with
    checked options.
    """

    name: str
    summary: str
    example: str
    options: tuple[Option | Group, ...]
    wrong_call: Callable[[argparse.Namespace], str]
    work: Check

    def add_to(self, commands: Commands) -> None:
        """Add its parser to those of the commands."""
        parser = commands.add_parser(
            self.name,
            help=self.summary.partition(". ")[0].removesuffix("."),
            description=textwrap.fill(self.summary, HELP_WIDTH),
            epilog=f"example:\n  {self.example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,  # a later option must not change what an abbreviation in a script means
        )
        for option in (*COMMON, *self.options):
            option.add_to(parser)
        parser.set_defaults(run=self._run, _refuse=parser.error)

    def _run(self, options: argparse.Namespace) -> None:
        """Check the options, outputs first, and do the work. Raises PushPredictorError or OSError."""
        if wrong := self.wrong_call(options):
            options._refuse(wrong)
        for option in sorted((*COMMON, *self.options), key=lambda each: not isinstance(each, Output)):
            option.check(options)
        self.work(options)


def command(
    name: str,
    summary: str,
    example: str,
    *options: Option | Group,
    wrong_call: Callable[[argparse.Namespace], str] = lambda options: "",
) -> Callable[[Check], Command]:
    """Make a function the work of a command with --json, --force and these options."""
    return lambda work: Command(name, summary, example, options, wrong_call, work)

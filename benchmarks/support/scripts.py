# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the scripts share: their docstring as help text, and tables in Markdown."""

from __future__ import annotations

import argparse
from collections.abc import Iterable


def parser_of(text: str | None) -> argparse.ArgumentParser:
    """A parser whose help begins with a script's docstring, as it is written there."""
    return argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)


def piped(cells: Iterable[object]) -> str:
    """A row of a table of these cells."""
    return f"| {' | '.join(map(str, cells))} |"


def ruled(head: str) -> str:
    """The head of a table, "| a | b |", and the line below it."""
    return f"{head}\n{'|---' * (head.count('|') - 1)}|"

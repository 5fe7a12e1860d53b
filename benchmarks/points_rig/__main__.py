# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Command line: `python -m benchmarks.points_rig make --out DATA --truth TRUTH --seed S --count N`."""

from __future__ import annotations

import argparse
import sys

from benchmarks.points_rig.pairs import make_pair, write_pair
from benchmarks.support.making import add_make, make_missing


def make(options: argparse.Namespace, number: int) -> None:
    """Make one pair of recordings with its truth."""
    write_pair(make_pair(options.seed, number, options.training, options.later), options.out, options.truth)


def main() -> int:
    """Make the pairs of recordings that are still missing; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.points_rig")
    add_make(parser.add_subparsers(required=True).add_parser("make", help="make pairs with their truth"), make)
    return make_missing(parser.parse_args())


if __name__ == "__main__":
    sys.exit(main())

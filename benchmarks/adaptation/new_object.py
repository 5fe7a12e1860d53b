# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A new object: a prior model, ten pushes, and the prior adapted by them, next to a GP of 200 pushes.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.adaptation.new_object [--data FOLDER]

On the twenty simulated pools of benchmarks/models/active.py, and with --data on the five folds of mit_square. A prior
trained on the ten pushes by `push_predictor train --kind prior` is the third. The GP has no mechanics; mit_square has
fewer than 200 pushes, so that it gets all of four folds. The ten are drawn at random, the same for all models.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.models.active import Case, cases_of
from push_predictor.adaptation import Adaptation
from push_predictor.evaluation.estimate import by_push, total_exact_nlpd, total_nmse
from push_predictor.evaluation.push_scores import PushScores, pooled, push_scores
from push_predictor.evaluation.validation import compare
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import empty_table

SHAPES, SURFACES = ("rect1", "ellip1", "hex", "ellip2", "ellip3"), ("abs", "plywood", "pu", "delrin")
# rect1:abs:21 to ellip3:delrin:40, those of benchmarks/models/RESULTS.md
POOLS = tuple(
    f"{shape}:{surface}:{21 + 5 * i % 20 + i // 4}"
    for i, (shape, surface) in enumerate((shape, surface) for surface in SURFACES for shape in SHAPES)
)
FEW, MANY = 10, 200
MODELS = ("prior, no push", f"prior, trained on {FEW}", f"adapted by {FEW}", f"GP of {MANY}")


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help="the folder of the measured data")
    options = parser.parse_args()
    print("| pushes of | model | NMSE (95 %) | exact NLPD (95 %) | in 95 % (dx dy dtheta) |\n|" + 5 * " --- |")
    for name, cases in ():
        pass


if __name__ == "__main__":
    main()

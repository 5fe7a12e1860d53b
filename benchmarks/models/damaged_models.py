# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Load damaged copies of model files: each is refused, or predicts exactly as the undamaged file does.

    python -m benchmarks.models.damaged_models [--copies 2000] [--seed 0]

The damage is random and seeded. The run ends at the first copy that loads and predicts something else, and names its
seed and number. test/faults/test_faults_models.py tries 60 copies of each kind of model.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.models.made_up_models import drifting_effect, extended_model, made_up_table, square_rig
from benchmarks.support.scripts import parser_of
from push_predictor.errors import ModelFileError
from push_predictor.models.prediction import Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import empty_table

KINDS = ("analytical", "prior", "gp", "vhgp", "sparse", "extended")
CORNERS = np.array([[0.04, 0.04, 0.25], [-0.04, 0.04, 0.25], [-0.04, -0.04, 0.25], [0.04, -0.04, 0.25]])
WINDOWS, PROBES = 75, 12  # to train on, to compare predictions on


def main() -> None:
    """Print, for each kind of model, how many copies were refused and how many predict as before."""
    parser = parser_of(__doc__)
    parser.add_argument("--copies", type=int, default=2000, help="of each kind of model (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the damage (default %(default)s)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        files = write_models(Path(folder))
        for kind in KINDS:
            begun = time.perf_counter()
            refused, loaded, slowest = try_copies(files, kind, options.copies, options.seed)
            print(
                f"{kind}: {refused} refused, {loaded} predict as the undamaged file, longest load {slowest:.2f} s, "
                f"{time.perf_counter() - begun:.0f} s in total"
            )


def write_models(folder: Path) -> dict[str, Path]:
    """Write a model file of every kind into the folder; its path by kind."""
    files = {kind: folder / f"{kind}.model" for kind in KINDS}
    for kind, model in models_of_every_kind().items():
        save_model(model, files[kind])
    return files


def models_of_every_kind() -> dict[str, PushModel]:
    """A small model of every kind, by kind."""
    table, rig = made_up_table(WINDOWS, 0), square_rig()
    models = {
        kind: train_model(table, rig, kind, name=kind, options=TrainingOptions(mean="zero"))
        for kind in ("analytical", "gp", "vhgp")
    }
    models["sparse"] = train_model(table, rig, "vhgp", name="sparse", options=TrainingOptions(inducing=15, mean="zero"))
    on_corners = replace(rig, support_points=CORNERS)
    models["prior"] = train_model(empty_table(), on_corners, "prior", name="prior")
    drifting = extended_model(models["gp"], drifting_effect("contact_friction", 0.1))
    return {**models, "extended": replace(drifting, name="extended")}


def try_copies(files: dict[str, Path], kind: str, copies: int, seed: int) -> tuple[int, int, float]:
    """Copies refused, copies loaded, longest load in s. Raises SystemExit for a copy that predicts something else."""
    data, other = undamaged_bytes(files, kind)
    expected, rng = predict_probes(load_model(files[kind])), np.random.default_rng(seed)
    path, refused, slowest = files[kind].with_name("damaged.model"), 0, 0.0
    for number in range(copies):
        path.write_bytes(damage(data, other, rng))
        begun = time.perf_counter()
        try:
            model = load_model(path)
        except ModelFileError:
            refused += 1
        else:
            if not equal(predict_probes(model), expected):
                sys.exit(f"{kind}, seed {seed}, copy {number}: the damaged file predicts something else")
        slowest = max(slowest, time.perf_counter() - begun)
    return refused, copies - refused, slowest


def undamaged_bytes(files: dict[str, Path], kind: str) -> tuple[bytes, bytes]:
    """The file of this kind, and one of another kind whose beginning may overwrite it."""
    return files[kind].read_bytes(), files["vhgp" if kind == "gp" else "gp"].read_bytes()


def damage(data: bytes, other: bytes, rng: np.random.Generator) -> bytes:
    """A copy that is cut, has a hole of zeros, begins like another file, or has flipped bits."""
    copy, at = bytearray(data), int(rng.integers(0, len(data)))
    match int(rng.integers(0, 6)):
        case 0:
            del copy[at:]
        case 1:
            copy[at : at + 64] = bytes(len(copy[at : at + 64]))
        case 2:
            copy[:at] = other[:at]
        case _:
            for place in {at, *rng.integers(0, len(data), int(rng.integers(0, 3))).tolist()}:
                copy[place] ^= 1 << int(rng.integers(0, 8))
    return bytes(copy)


def predict_probes(model: PushModel) -> Prediction:
    """What a model predicts for pushes that it was not trained on."""
    table = made_up_table(PROBES, 9)
    return model.predict_rows(table.inputs, table.duration, table.covariates)


def equal(one: Prediction, other: Prediction) -> bool:
    """Whether two predictions have the same mean and covariance, bit by bit."""
    return np.array_equal(one.mean, other.mean) and np.array_equal(one.covariance, other.covariance)


if __name__ == "__main__":
    main()

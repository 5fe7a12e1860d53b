# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Train the default model of each training recording: the only module here that uses the project."""

from __future__ import annotations

import sys
from pathlib import Path

import joblib

from benchmarks.blind.recordings import MODEL
from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.load import load_data, load_rig_for


def train_all(data: Path, rows: int, cores: int = 1) -> None:
    """Train the models that are missing in the folders of `data`."""
    folders = sorted(path.parent for path in data.glob("*/training"))
    if not folders:
        raise SystemExit(f"--data: {data} contains no NNN/training; make writes them")
    missing = [folder for folder in folders if not (folder / MODEL).exists()]
    joblib.Parallel(n_jobs=cores)(joblib.delayed(train_one)(folder, rows) for folder in missing)


def train_one(folder: Path, rows: int) -> None:
    """Train a VHGP with the mean that predicts better, on at most `rows` random windows."""
    rig = load_rig_for([folder / "training"])
    table = load_data([folder / "training"], rig)
    options = TrainingOptions(n_train=min(rows, len(table)), mean="auto")
    save_model(train_model(table, rig, "vhgp", name=folder.name, options=options), folder / MODEL)
    print(folder / MODEL, file=sys.stderr, flush=True)

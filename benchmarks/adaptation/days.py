# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The folder of a rig: tables of its windows on Monday and Tuesday, and the model that was trained on Monday's.

before.csv.gz and after_NAME.csv.gz with their NAME.rig.yaml, and deployed.pushmodel.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from benchmarks.adaptation.rigs import CHANGES, MONDAY, write_day
from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.rig import save_rig
from push_predictor.recordings.table_file import rig_path, write_table
from push_predictor.residuals.evidence.loading import LoadedData, load_evidence

AFTER, ENDING, MODEL = "after_", ".csv.gz", "deployed.pushmodel"


def make(data: Path, rig: str, seed: int) -> None:
    """Simulate the recordings of a rig and keep their windows."""
    for name in (MONDAY, *CHANGES):
        table = data / f"{rig}_{seed}" / f"{'' if name == MONDAY else AFTER}{name}{ENDING}"
        if not table.exists():
            with tempfile.TemporaryDirectory() as work:
                write_day(Path(work) / name, rig, seed, name)
                cut([Path(work) / name], table)


def cut_rig(data: Path, bags: Path) -> None:
    """Cut before.mcap and every after_NAME.mcap in a folder PARENT/RIG; their folder is named PARENT_RIG."""
    for bag in sorted((*bags.glob(f"{MONDAY}.mcap"), *bags.glob(f"{AFTER}*.mcap"))):
        cut([bag], data / f"{bags.parent.parent.name}_{bags.name}" / f"{bag.stem}{ENDING}")


def cut_measured(data: Path, measured: Path) -> None:
    """Measured pushes in their order: for each log of mlab the one before it is Monday's; mcube's runs by block."""
    with tempfile.TemporaryDirectory() as work:
        import_source("mlab", [measured / "mlab" / "sensor_log"], Path(work))
        logs = sorted(Path(work).glob("*.csv"), key=lambda log: log.stem.partition("_exp_")[2])  # by day and time
        for number, (before, after) in enumerate(pairwise(logs), start=1):
            _pair([before], [after], data / f"mlab_{number}")
    with tempfile.TemporaryDirectory() as work:
        import_source("mcube", [measured / "mcube_preliminary"], Path(work))
        aluminium, steel = (sorted(Path(work).glob(f"{block}_block*")) for block in ("Al", "St"))
        _pair(aluminium, steel, data / "mcube_1")
        _pair(aluminium[:2], aluminium[2:], data / "mcube_2")
        _pair(steel[:2], steel[2:], data / "mcube_3")


def cut(data: Sequence[Path], table: Path) -> None:
    """Write the windows of recordings or tables and the rig of the first."""
    table.parent.mkdir(parents=True, exist_ok=True)
    save_rig(load_rig_for(data[:1]), rig_path(table))
    write_table(table, load_data(data))
    print(table, *(path.name for path in data), file=sys.stderr, flush=True)


def train(folder: Path) -> None:
    """Train what `push_predictor train --kind vhgp --mean mechanics` gives on Monday's windows, unless it is there."""
    if not (folder / MODEL).exists():
        monday, options = [folder / f"{MONDAY}{ENDING}"], TrainingOptions(mean="mechanics")
        model = train_model(load_data(monday), load_rig_for(monday), "vhgp", name=folder.name, options=options)
        save_model(model, folder / MODEL)
        print(model, file=sys.stderr, flush=True)


def tuesdays(folder: Path) -> Iterator[tuple[str, LoadedData]]:
    """The changes of a rig and what was recorded after them."""
    for path in sorted(folder.glob(f"{AFTER}*{ENDING}")):
        yield path.name[len(AFTER) : -len(ENDING)], load_evidence([path])


def _pair(before: Sequence[Path], after: Sequence[Path], folder: Path) -> None:
    cut(before, folder / f"{MONDAY}{ENDING}")
    cut(after, folder / f"{AFTER}measured{ENDING}")

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The independent rig: reproducible bags, contact forces within Coulomb's law, and complete truth files."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from benchmarks.blind.recordings import MODEL
from benchmarks.foreign import __main__ as command
from benchmarks.foreign import engine, recording
from benchmarks.foreign.change import Change
from benchmarks.foreign.drivers import Driver
from benchmarks.foreign.effects import Effect
from benchmarks.foreign.plan import PushDistribution
from benchmarks.foreign.recording import SessionInputs
from benchmarks.foreign.rig import Rig, draw_rig
from push_predictor import load_model

PACKAGE = Path(command.__file__).parent
TRUTH_KEYS = {
    "number", "group", "seed", "engine", "shape", "surface", "friction", "pushes", "training_pushes", "kind", "channel",
    "names", "covariates", "form", "size", "value", "unit", "place", "place_time", "second", "clean_ratio",
}  # fmt: skip


@pytest.fixture(autouse=True, scope="module")
def _coarse_steps() -> Iterator[None]:
    """Coarser steps than for a recording, and fewer judged pushes, to save time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "STEPS", 50)
        patch.setattr(recording, "JUDGED", 3)
        yield


@pytest.fixture(scope="module")
def rig() -> Rig:
    return draw_rig(np.random.default_rng(4), "rect1")


@pytest.fixture(scope="module")
def inputs(rig: Rig) -> SessionInputs:
    return recording.draw_inputs(np.random.default_rng(5), rig, 12, PushDistribution())


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Folders of the recordings and of their truth."""
    return _make(tmp_path_factory.mktemp("made"))


def _make(folder: Path) -> tuple[Path, Path]:
    data, truth = folder / "data", folder / "truth"
    options = f"make --out {data} --truth {truth} --seed 2 --count 1 --training 3 --later 3"
    assert command.main(options.split()) == 0
    return data, truth


@pytest.mark.long
def test_a_truth_file_has_all_keys_and_a_bag_its_rig(made: tuple[Path, Path]) -> None:
    data, truth = made
    assert set(json.loads((truth / "000.json").read_text())) == TRUTH_KEYS
    with (data / "000/new/new_0.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        rig_record = {record.name: record.metadata for record in reader.iter_metadata()}["push_rig"]
        arrivals = [message.log_time for _, _, message in reader.iter_messages(log_time_order=False)]
    assert summary is not None and summary.statistics is not None
    assert len(arrivals) == summary.statistics.message_count
    assert arrivals == sorted(arrivals)
    topics = {channel.topic for channel in summary.channels.values()}
    assert {"/slider/pose", "/pusher/pose", "/pusher/wrench", "/surface/temperature"} <= topics
    assert {"shape", "outline", "pusher_radius", "surface", "object_mass"} <= set(rig_record)


def test_contact_forces_lie_in_the_friction_cone(rig: Rig, inputs: SessionInputs) -> None:
    noiseless = inputs.noise.scaled(0.0)
    motion = engine.simulate(rig, inputs.plan, inputs.facts, noiseless, ())
    heading = motion.pose[:, :, 2]
    x, y = motion.force[:, :, 0], motion.force[:, :, 1]
    body = np.stack([np.cos(heading) * x + np.sin(heading) * y, np.cos(heading) * y - np.sin(heading) * x], axis=-1)
    # While the tip is on one side of the square, the side's inward normal is a body axis.
    normal = np.max(np.abs(body), axis=-1)
    tangential = np.min(np.abs(body), axis=-1)
    _, outward = rig.outline.boundary(inputs.plan.contact)
    on_side = np.abs(inputs.plan.contact * 4 % 1 - 0.5) < 0.3
    pressed = np.sum(body * -outward[:, None], axis=-1)[on_side]
    assert np.all(pressed >= 0) and np.median(pressed) > 0.3
    assert np.all(tangential[on_side] <= rig.contact_friction * normal[on_side] * (1 + 1e-9))


def test_the_tip_stays_at_the_outline_but_for_its_compliance(rig: Rig, inputs: SessionInputs) -> None:
    motion = engine.simulate(rig, inputs.plan, inputs.facts, inputs.noise, ())
    travelled = inputs.plan.speed[:, None] * motion.time
    ahead = np.stack([np.cos(motion.heading), np.sin(motion.heading)], axis=-1)
    apart = motion.touch[:, None] + travelled[:, :, None] * ahead[:, None] - motion.pose[:, :, :2]
    heading = motion.pose[:, :, 2]
    x = np.cos(heading) * apart[:, :, 0] + np.sin(heading) * apart[:, :, 1]
    y = np.cos(heading) * apart[:, :, 1] - np.sin(heading) * apart[:, :, 0]
    gap = rig.outline.closest(np.stack([x, y], axis=-1).reshape(-1, 2))[2] - 0.00475
    strongest = np.max(np.linalg.norm(motion.force, axis=-1))
    assert gap.min() > -strongest / rig.stiffness - 1e-4


@pytest.mark.long
def test_clean_ratio_is_zero_without_a_change_and_large_with_one(rig: Rig, inputs: SessionInputs) -> None:
    rng = np.random.default_rng(0)
    unchanged = engine.simulate(rig, inputs.plan, inputs.facts, inputs.noise, ())
    assert recording.clean_ratio(rng, rig, inputs, unchanged, Change("none")) == 0.0
    tilt = Effect("tilted_surface", 0.1, Driver("constant", "constant"))
    idle = Effect("tilted_surface", 0.0, Driver("constant", "constant"))
    tilted = engine.simulate(rig, inputs.plan, inputs.facts, inputs.noise, (tilt,))
    assert recording.clean_ratio(rng, rig, inputs, tilted, Change("library", (tilt,))) > 1.0
    assert recording.clean_ratio(rng, rig, inputs, unchanged, Change("library", (idle,))) < 0.01


def test_only_the_module_that_trains_uses_the_project() -> None:
    """The recordings are independent of the code that is judged by them."""
    users = set()
    rigs = (PACKAGE.parent / room for room in ("foreign", "points_rig", "support"))
    for path in (path for rig in rigs for path in rig.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if any(name.split(".")[0] == "push_predictor" or name.startswith("benchmarks.blind") for name in names):
                users.add(path.name)
    assert users == {"train.py"}


@pytest.mark.long
def test_training_writes_the_models_that_are_missing(
    made: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    data, truth = made
    command.main(f"train --data {data} --rows 15".split())
    model = load_model(data / "000" / MODEL)
    assert (model.name, model.kind, len(model.training)) == ("000", "vhgp", 15)
    capsys.readouterr()
    command.main(f"train --data {data} --rows 15".split())
    assert capsys.readouterr().err == ""
    with pytest.raises(SystemExit, match="contains no NNN/training"):
        command.main(f"train --data {truth}".split())

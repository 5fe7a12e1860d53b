# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Measured sets for the paper's tables: a made-up copy of the MIT set, written in its own format by our simulator."""

from __future__ import annotations

import json
import shutil
import zipfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.data.measured import measured_corpora
from push_predictor_paper.fits.fit import Fit, scores
from push_predictor_paper.work import Work

from push_predictor.errors import ImportSourceError
from push_predictor.recordings.importers.cleaning import nanoseconds
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.read import require_rig
from push_predictor.recordings.streams import PoseStream, Recording, taken
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.simulation.pushes import PushPlan
from push_predictor.simulation.rig_simulator import SimulationSpec, simulate

PAIRS = (("rect1", "abs"), ("rect1", "plywood"), ("ellip1", "abs"), ("ellip1", "plywood"))
PUSHES = 12
SPEEDS = (0.02, 0.05)
LIFTED = 0.02  # m, of the tip


@cache
def simulated(shape: str, surface: str) -> Recording:
    """Pushes whose way is about six windows long."""
    rng = np.random.default_rng([len(shape), len(surface)])
    speed = np.resize(SPEEDS, PUSHES)
    angle = rng.uniform(-0.6, 0.6, PUSHES)
    plan = PushPlan(rng.random(PUSHES), angle, speed, 1.3 * speed)
    return simulate(SimulationSpec(shape, surface, plan, name=f"{shape}_{surface}"))


@cache
def single_pushes(shape: str, surface: str) -> list[Recording]:
    """Each push by itself, from the tip's coming down to its lifting, as far as the set can hold it.

    That is: heights 0, and times that are Unix seconds in doubles (to 0.2 us, which can shift a touch by a sample).
    """
    recording = simulated(shape, surface)
    slider, tip, wrench = recording.slider, recording.pusher, recording.wrench
    assert wrench is not None
    down = np.flatnonzero(np.diff(np.concatenate([[False], tip.z < LIFTED, [False]]).astype(int)))
    return [
        replace(
            recording,
            slider=planar(between(slider, tip.stamp[first], tip.stamp[last])),
            pusher=planar(between(tip, tip.stamp[first], tip.stamp[last])),
            wrench=between(wrench, tip.stamp[first], tip.stamp[last]),
        )
        for first, last in zip(down[::2], down[1::2] - 1, strict=True)
    ]


def between(stream: Any, begin: int, end: int) -> Any:
    rows = (stream.stamp >= begin) & (stream.stamp <= end)
    kept = taken(stream, rows)
    return replace(kept, stamp=nanoseconds(kept.stamp / 1e9))


def planar(stream: PoseStream) -> PoseStream:
    return replace(stream, z=np.zeros(len(stream.stamp)))


def own_windows(shape: str, surface: str) -> PushTable:
    """The windows of the pushes before they were written as files of the set."""
    windows = [find_windows(push, require_rig(push)) for push in single_pushes(shape, surface)]
    return windows_to_table([window for of_push in windows for window in of_push])


def mit_files(shape: str, surface: str) -> dict[str, str]:
    """Name and JSON of each push."""
    names = [
        f"motion_surface={surface}_shape={shape}_a=0_v={1e3 * SPEEDS[k % 2]:.0f}_i={k}.000_s=0.500_t=0.000.json"
        for k in range(PUSHES)
    ]
    return {name: json.dumps(_streams(push)) for name, push in zip(names, single_pushes(shape, surface), strict=True)}


def _streams(push: Recording) -> dict[str, list[list[float]]]:
    slider, tip, wrench = push.slider, push.pusher, push.wrench
    assert wrench is not None
    return {
        "tip_pose": np.column_stack([tip.stamp / 1e9, tip.x, tip.y, tip.heading]).tolist(),
        "object_pose": np.column_stack([slider.stamp / 1e9, slider.x, slider.y, slider.heading]).tolist(),
        "ft_wrench": np.column_stack([wrench.stamp / 1e9, wrench.fx, wrench.fy, wrench.torque]).tolist(),
    }


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two shapes on two surfaces: one pair as loose files, the others as zip archives."""
    folder = tmp_path_factory.mktemp("mit")
    for shape, surface in PAIRS[1:]:
        with zipfile.ZipFile(folder / f"{shape}_{surface}.zip", "w") as archive:
            for name, content in mit_files(shape, surface).items():
                archive.writestr(f"{surface}/{name}", content)
    (folder / "abs" / "rect1").mkdir(parents=True)
    for name, content in mit_files(*PAIRS[0]).items():
        (folder / "abs" / "rect1" / name).write_text(content)
    return folder


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scratch")


@pytest.fixture(scope="module")
def corpus(copy: Path, scratch: Path) -> Corpus:
    (found,) = measured_corpora(copy, Work(scratch / "work", cores=1), scratch)
    return found


@pytest.mark.long
def test_a_copy_of_the_mit_set_is_one_corpus_with_a_set_of_every_shape_on_every_surface(corpus: Corpus) -> None:
    assert corpus.origin == "measured"
    assert set(corpus.sets) == set(PAIRS)
    assert corpus.reference == ("rect1", "plywood") == next(iter(corpus.sets))
    assert "your copy: 4 sets of 12 straight pushes at 20 to 50 mm/s" in corpus.title
    for (shape, surface), pushes in corpus.sets.items():
        assert (pushes.rig.shape, pushes.rig.surface) == (shape, surface)


@pytest.mark.long
@pytest.mark.parametrize("pair", PAIRS)
def test_its_windows_are_those_of_the_pushes_that_were_written_to_it(corpus: Corpus, pair: tuple[str, str]) -> None:
    ours, theirs = corpus.sets[pair].table, own_windows(*pair)
    assert len(ours) == len(theirs) and len(ours.pushes) == PUSHES
    order, expected = (np.lexsort(np.round(t.inputs, 4).T) for t in (ours, theirs))
    np.testing.assert_allclose(ours.inputs[order], theirs.inputs[expected], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(ours.outcomes[order], theirs.outcomes[expected], rtol=0.0, atol=1e-12)


@pytest.mark.long
def test_a_push_cut_into_files_gives_the_windows_of_the_whole_recording_within_one(corpus: Corpus) -> None:
    """A file has little free motion to measure the force's noise: touch is seen up to a sample earlier or later."""
    recording = simulated(*PAIRS[0])
    whole = [window.push_id for window in find_windows(recording, require_rig(recording))]
    ours = corpus.sets[PAIRS[0]].table.push_id.tolist()
    counts = [[ids.count(push) for push in dict.fromkeys(ids)] for ids in (sorted(ours), whole)]
    assert np.max(np.abs(np.subtract(*counts))) <= 1


@pytest.mark.long
def test_the_learning_curves_scores_run_on_it(corpus: Corpus, scratch: Path) -> None:
    fits = [(pair, Fit("gp", n, split, 0)) for pair in PAIRS[:2] for n in (20, 1000) for split in ("push", "random")]
    done = scores(Work(scratch / "work", cores=1), corpus, fits)
    assert {(pair, fit.n) for pair, fit in done} == {(pair, 20) for pair in PAIRS[:2]}, (
        "1000 windows are more than it has"
    )
    assert all(
        np.all(score.push_scores.totals().nmse < 1.0) for (_, fit), score in done.items() if fit.split == "random"
    )


@pytest.mark.long
def test_the_sets_are_kept_as_tables_that_can_be_trained_from(corpus: Corpus, scratch: Path) -> None:
    path = scratch / "ellip1_abs.csv"
    np.testing.assert_array_equal(load_data([path]).outcomes, corpus.sets["ellip1", "abs"].table.outcomes)
    assert load_rig_for([path]).shape == "ellip1"
    assert "48 recordings" in (scratch / "import.txt").read_text()


@pytest.mark.long
def test_imports_a_file_again_only_after_a_change(copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "mit"
    shutil.copytree(copy / "abs", folder)
    (first,) = measured_corpora(folder, Work(tmp_path / "work", cores=1), tmp_path / "scratch")
    with monkeypatch.context() as unreadable:
        unreadable.setattr("push_predictor_paper.data.measured.read_mit", lambda *_: pytest.fail("read again"))
        (again,) = measured_corpora(folder, Work(tmp_path / "work", cores=1), tmp_path / "scratch")
    np.testing.assert_array_equal(first.sets[PAIRS[0]].table.outcomes, again.sets[PAIRS[0]].table.outcomes)
    next(folder.rglob("*.json")).write_text("{}")
    (less,) = measured_corpora(folder, Work(tmp_path / "work", cores=1), tmp_path / "scratch")
    assert len(less.sets[PAIRS[0]].table.pushes) == PUSHES - 1
    assert "file refused" in (tmp_path / "scratch" / "import.txt").read_text()


@pytest.mark.long
def test_a_push_that_lies_in_a_folder_and_in_an_archive_counts_once(copy: Path, tmp_path: Path) -> None:
    folder = tmp_path / "twice"
    shutil.copytree(copy / "abs", folder / "abs")
    with zipfile.ZipFile(folder / "abs.zip", "w") as archive:
        for path in (copy / "abs").rglob("*.json"):
            archive.write(path, path.name)
    (found,) = measured_corpora(folder, Work(tmp_path / "work", cores=1), tmp_path / "scratch")
    assert len(found.sets[PAIRS[0]].table) == len(own_windows(*PAIRS[0]))


@pytest.mark.long
def test_skips_and_names_sets_too_small_for_a_learning_curve(copy: Path, tmp_path: Path) -> None:
    folder = tmp_path / "mit"
    shutil.copytree(copy / "abs", folder)
    name, content = next(iter(mit_files("ellip1", "abs").items()))
    (folder / name).write_text(content)
    (folder / name.replace("ellip1", "butter")).write_text(content)
    (folder / name.replace("ellip1", "ellip2").replace("a=0", "a=1")).write_text(content)
    (folder / "notes.json").write_text("[]")
    (folder / "broken.zip").write_text("no archive")
    (found,) = measured_corpora(folder, Work(tmp_path / "work", cores=1), tmp_path / "scratch")
    assert list(found.sets) == [PAIRS[0]]
    for reason in ("broken.zip", "butter (its outline is not known)", "ellip1 on abs (too few; pushes: 1"):
        assert reason in found.notes[0]
    assert "ellip2" not in found.notes[0], "an accelerated push belongs to no table"


@pytest.mark.long
def test_folder_with_nothing_usable_is_an_error_that_names_what_is_accepted(copy: Path, tmp_path: Path) -> None:
    work = Work(tmp_path / "work", cores=1)
    (tmp_path / "empty").mkdir()
    with pytest.raises(
        ImportSourceError, match=r"empty: holds nothing .*mit_square/pushes_.*motion_surface=.*60 windows"
    ):
        measured_corpora(tmp_path / "empty", work, tmp_path / "scratch")
    shutil.copy(next(copy.rglob("*.json")), tmp_path / "empty")
    with pytest.raises(ImportSourceError, match=r"rect1 on abs \(too few; pushes: 1"):
        measured_corpora(tmp_path / "empty", work, tmp_path / "scratch")


@pytest.mark.long
def test_the_square_table_is_a_corpus_of_its_own(copy: Path, tmp_path: Path) -> None:
    folder = tmp_path / "data"
    (folder / "mit_square").mkdir(parents=True)
    shutil.copytree(copy / "abs", folder / "mit")
    rng, rows = np.random.default_rng(0), 120
    columns = {name: rng.random(rows) for name in ("c", "beta", "dx", "dy", "dtheta")}
    groups = {"push_group_est": np.arange(rows) // 10, "row_id": np.arange(rows)}
    np.savez(folder / "mit_square" / "pushes_120.npz", **columns, **groups)
    square, mit = measured_corpora(folder, Work(tmp_path / "work", cores=1), tmp_path / "scratch")
    assert list(square.sets) == [("rect1", "unknown")] and list(mit.sets) == [PAIRS[0]]
    assert "120 overlapping windows of 12 pushes" in square.title and "estimate" in square.title
    np.testing.assert_array_equal(square.sets["rect1", "unknown"].table.outcomes[:, 1], -columns["dy"])

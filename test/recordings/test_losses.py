# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Lost data are said wherever a recording is read; what a name or a byte can tell is no loss."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import zstandard
from lab_bags import Lab, short_recording

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.message_types import POSE
from push_predictor.recordings.bag.messages import Notes
from push_predictor.recordings.bag.reader import is_bag_file
from push_predictor.recordings.checks.check import LISTED, DataChecks, check_recording
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table_file import is_recording
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.write import write_recording

PARTS = 4


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording in four files, named as rosbag2 does, with metadata.yaml."""
    folder, whole = tmp_path_factory.mktemp("split") / "bag", short_recording(4.0)
    write_recording(folder, whole)
    for number in range(PARTS):
        write_recording(folder / f"bag_{number}.mcap", short_recording(1.0, after=float(number)))
    metadata = folder / "metadata.yaml"
    listed = "".join(f"  - bag_{number}.mcap\n" for number in range(PARTS))
    metadata.write_text(metadata.read_text().replace("  - bag_0.mcap\n", listed))
    return folder


@pytest.fixture
def split(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "bag"))


def lost(folder: Path) -> tuple[str, ...]:
    return read_recording(folder).losses


def warned(folder: Path) -> list[str]:
    recording, warnings = read_recording(folder), list[str]()
    assert recording.rig is not None
    DataChecks(False, warnings.append)(folder, recording, None)
    return [text for text in warnings if "Data of the recording are missing" in text]


def test_a_whole_split_recording_has_no_loss(split: Path) -> None:
    found = read_recording(split)
    assert len(found.slider) == len(short_recording(4.0).slider) and found.notes == ()
    assert not warned(split)


@pytest.mark.parametrize("number", [0, 2, 3])
def test_a_missing_file_is_a_loss_that_the_checks_warn_of(split: Path, number: int) -> None:
    (split / f"bag_{number}.mcap").unlink()
    assert lost(split) == (f"{split}: bag_{number}.mcap is listed in metadata.yaml but missing",)
    (warning,) = warned(split)
    assert f"bag_{number}.mcap is listed" in warning and "Copy missing files into the folder" in warning
    with pytest.raises(RecordingError, match="Data of the recording are missing"):
        recording = read_recording(split)
        DataChecks(True, print)(split, recording, recording.rig)


@pytest.mark.parametrize("number", [0, 1])
def test_without_metadata_a_gap_in_the_numbers_is_a_loss(split: Path, number: int) -> None:
    (split / "metadata.yaml").unlink()
    assert lost(split) == ()
    (split / f"bag_{number}.mcap").unlink()
    assert lost(split) == (f"{split}: bag_{number} is missing between the numbered files",)


def test_a_refusal_states_what_is_lost_since_that_may_be_the_cause(split: Path) -> None:
    (split / "bag_0.mcap").unlink()
    with pytest.raises(
        RecordingError, match=r"no such topic; .*; .*bag_0\.mcap is listed in metadata\.yaml but missing$"
    ):
        read_recording(split, topics=Topics("/tf:block"))


def test_files_that_were_named_otherwise_have_no_gap(split: Path) -> None:
    (split / "metadata.yaml").unlink()
    for number in range(PARTS):
        (split / f"bag_{number}.mcap").rename(split / f"run_{number + 5}.mcap")
    assert lost(split) == ()
    (split / "run_6.mcap").unlink()
    assert lost(split) == (f"{split}: run_6 is missing between the numbered files",)
    (split / "run_7.mcap").rename(split / "other.mcap")
    assert lost(split) == ()


def test_files_that_were_all_renamed_are_found_and_noted(split: Path) -> None:
    for number in range(PARTS):
        (split / f"bag_{number}.mcap").rename(split / f"monday {number}")
    found = read_recording(split)
    assert len(found.slider) == len(short_recording(4.0).slider)
    assert len(found.notes) == PARTS and found.losses == ()
    (split / "monday 3").unlink()
    assert len(lost(split)) == PARTS


@pytest.mark.parametrize("keep_metadata", [True, False])
@pytest.mark.parametrize("suffix", [".zstd", ""])
def test_compressed_files_are_known_by_their_bytes(split: Path, keep_metadata: bool, suffix: str) -> None:
    for number in range(PARTS):
        file = split / f"bag_{number}.mcap"
        file.with_name(f"{file.name}{suffix}").write_bytes(zstandard.compress(file.read_bytes()))
        if suffix:
            file.unlink()
    if not keep_metadata:
        (split / "metadata.yaml").unlink()
    (split / "bag_2.mcap").write_bytes((split / f"bag_2.mcap{suffix}").read_bytes())  # both of one are there
    found = read_recording(split)
    assert len(found.slider) == len(short_recording(4.0).slider) and found.notes == ()
    assert len(read_recording(split / f"bag_1.mcap{suffix}").slider) == len(short_recording(1.0, after=1.0).slider)


def test_a_file_is_a_recording_by_its_name_or_by_its_bytes(made: Path, tmp_path: Path) -> None:
    content = (made / "bag_0.mcap").read_bytes()
    for name, data in (("a", content), ("b.old", zstandard.compress(content)), ("c.mcap", b""), ("d.db3.zstd", b"")):
        (tmp_path / name).write_bytes(data)
        assert is_recording(tmp_path / name) and is_bag_file(tmp_path / name)
    for name, data in (("e.csv", b"velocity"), ("f", b""), ("g", zstandard.compress(b"none")), ("h.zstd", b"\x28\xb5")):
        (tmp_path / name).write_bytes(data)
        assert not is_bag_file(tmp_path / name)
    assert not is_bag_file(tmp_path / "absent")


def test_a_damaged_part_is_a_loss_and_a_file_that_was_not_closed_is_none(split: Path) -> None:
    data = bytearray((split / "bag_1.mcap").read_bytes())
    (split / "bag_1.mcap").write_bytes(data[:-30])
    found = read_recording(split)
    assert any("end of the file is missing" in note for note in found.notes) and not found.losses
    assert len(found.slider) == len(short_recording(4.0).slider) and found.rig is not None
    data[len(data) // 3] ^= 0xFF
    (split / "bag_1.mcap").write_bytes(data)
    found = read_recording(split)
    assert "a chunk was skipped" in found.losses[0] and set(found.losses) <= set(found.notes)
    assert 0 < len(found.slider) < len(short_recording(4.0).slider)


def test_a_wrench_of_a_foreign_type_is_a_loss(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    lab, whole = Lab(), short_recording(1.0)
    lab.pose("/slider/pose", POSE.name, whole.slider, "pose")
    lab.pose("/pusher/pose", POSE.name, whole.pusher, "pose")
    lab.add("/pusher/wrench", "geometry_msgs/msg/Twist", whole.slider.stamp[:1], iter([{}]))
    found = read_recording(lab.mcap(tmp_path / "a.mcap"))
    assert found.wrench is None
    assert found.losses == ("/pusher/wrench: 1 messages have type 'geometry_msgs/msg/Twist'; discarded",)


def test_the_finding_lists_a_few_losses_and_counts_the_others() -> None:
    whole = short_recording(1.0)
    assert whole.rig is not None
    for count in (LISTED, LISTED + 2):
        damaged = Recording(
            "a", whole.rig, whole.slider, whole.pusher, whole.wrench, losses=tuple(f"loss {k}" for k in range(count))
        )
        first = check_recording(damaged, whole.rig)[0]
        assert (first.name, first.severity) == ("data_lost", "warning")
        assert "loss 2" in first.sentence and "loss 3" not in first.sentence
        assert f"(losses: {count})" in first.sentence
        assert first.values["losses"].value == count


def test_notes_are_kept_once_and_with_what_was_lost() -> None:
    notes, others = Notes(), Notes()
    notes.add("a")
    notes.add("a", lost=True)
    others.add("b", lost=True)
    notes.add_all(others)
    assert notes == ["a", "b"] and notes.losses == ["b"]

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Bags of rosbag2 in sqlite3 and of ROS 1 open wherever a recording is asked for."""

from __future__ import annotations

import sqlite3
import sys
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("rosbags")
from lab_bags import Lab, write_db3, write_ros1
from test_lab_topics import NAMES, TIP, UR, VICON, assert_same_windows, original, tf_lab, vicon_and_ur, wrench

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.topics import Topics


def own_type() -> Lab:
    lab = Lab(TIP)
    lab.pose("/slider", "geometry_msgs/msg/PoseStamped", original().slider, "pose")
    lab.pose("/tip", "lab_msgs/msg/Tip", original().pusher, "odom.pose.pose", "odom.pose.header")
    return lab


OWN = Topics("/slider", "/tip.odom.pose.pose")


def db3_file(lab: Lab, path: Path) -> Path:
    return next(write_db3(lab, path).glob("*.db3"))


def db3_without_metadata(lab: Lab, path: Path) -> Path:
    (write_db3(lab, path) / "metadata.yaml").unlink()
    return path


def bag_file(lab: Lab, path: Path) -> Path:
    return write_ros1(lab, path.with_suffix(".bag"))


def bag_folder(lab: Lab, path: Path) -> Path:
    path.mkdir()
    write_ros1(lab, path / "lab.bag")
    return path


@pytest.mark.parametrize(
    ("write", "kind"),
    [
        *((write, "transforms") for write in (db3_file, db3_without_metadata, bag_folder)),
        *((write, "tf") for write in (write_db3, bag_file)),
    ],
)
def test_each_container_gives_the_windows_of_the_original(tmp_path: Path, write: object, kind: str) -> None:
    lab = vicon_and_ur() if kind == "transforms" else tf_lab()
    topics = NAMES if kind == "transforms" else Topics("/tf:block", "/tf:tip", "/netft")
    if kind == "tf":
        lab.wrench("/netft", wrench(), "geometry_msgs/msg/WrenchStamped", "wrench")
    path = write(lab, tmp_path / "lab")  # type: ignore[operator]
    assert_same_windows(read_recording(path, rig=original().rig, topics=topics))


@pytest.mark.parametrize(("write", "storage"), [(write_db3, "sqlite3"), (db3_file, "sqlite3"), (bag_file, "")])
def test_a_bag_knows_rosbag2s_name_of_its_format(tmp_path: Path, write: object, storage: str) -> None:
    assert open_bag(write(vicon_and_ur(), tmp_path / "lab")).storage == storage  # type: ignore[operator]


@pytest.mark.parametrize("write", [write_db3, bag_file])
def test_a_laboratorys_own_type_is_read_by_the_definition_in_the_bag(tmp_path: Path, write: object) -> None:
    found = read_recording(write(own_type(), tmp_path / "lab"), topics=OWN)  # type: ignore[operator]
    assert found.pusher.x.tolist() == original().pusher.x.tolist()
    assert found.pusher.stamp.tolist() == original().pusher.stamp.tolist()


def test_an_older_db3_has_no_definition_of_an_own_type(tmp_path: Path) -> None:
    path = write_db3(own_type(), tmp_path / "lab", version=8)
    with sqlite3.connect(next(path.glob("*.db3"))) as database:
        database.execute("DROP TABLE IF EXISTS message_definitions")
    with pytest.raises(RecordingError, match="'lab_msgs/msg/Tip', and the bag does not contain its definition"):
        read_recording(path, topics=OWN)
    standard = write_db3(vicon_and_ur(), tmp_path / "standard", version=8)
    with sqlite3.connect(next(standard.glob("*.db3"))) as database:
        database.execute("DROP TABLE IF EXISTS message_definitions")
    assert_same_windows(read_recording(standard, rig=original().rig, topics=NAMES))


def test_nothing_is_written_next_to_a_db3(tmp_path: Path) -> None:
    path = write_db3(vicon_and_ur(), tmp_path / "lab")
    database = sqlite3.connect(next(path.glob("*.db3")))
    database.execute("PRAGMA journal_mode = WAL")  # rosbag2's preset `resilient`
    database.close()
    before = sorted(path.iterdir())
    for _ in open_bag(path).messages():
        assert sorted(path.iterdir()) == before


def test_messages_in_the_log_of_a_killed_recorder_are_read(tmp_path: Path) -> None:
    path = db3_file(vicon_and_ur(), tmp_path / "lab")
    database = sqlite3.connect(path)
    database.execute("PRAGMA journal_mode = WAL")
    database.execute("INSERT INTO messages(topic_id, timestamp, data) SELECT topic_id, 1, data FROM messages LIMIT 3")
    database.commit()
    try:
        assert sum(1 for _ in open_bag(path).messages()) == len(vicon_and_ur().messages) + 3
    finally:
        database.close()


@pytest.mark.parametrize("write", [db3_file, bag_file])
def test_a_damaged_bag_is_an_error_or_a_note(tmp_path: Path, write: object) -> None:
    """Never a traceback, wherever it is cut or overwritten."""
    path = write(vicon_and_ur(), tmp_path / "lab")  # type: ignore[operator]
    whole = path.read_bytes()
    outcomes = set()
    for part in (20, 100, 4096, len(whole) // 3, len(whole) // 2, len(whole) - 50):
        for damaged in (whole[:part], whole[:part] + b"\xff" * 3000 + whole[part + 3000 :]):
            path.write_bytes(damaged)
            try:
                notes = read_recording(path, topics=NAMES).notes
                outcomes.add("noted" if any(str(path) in note or "discarded" in note for note in notes) else "whole")
            except RecordingError as error:
                assert str(path) in str(error)
                outcomes.add("refused")
    assert "refused" in outcomes


def test_messages_before_the_damage_of_a_db3_are_kept(tmp_path: Path) -> None:
    path = db3_file(vicon_and_ur(), tmp_path / "lab")
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 20_000] = b"\xff" * 20_000
    path.write_bytes(bytes(data))
    bag = open_bag(path)
    assert 100 < sum(1 for _ in bag.messages()) < len(vicon_and_ur().messages)
    assert any("damaged after" in note and "the rest is not read" in note for note in bag.notes)


def test_a_database_that_is_no_bag_and_another_encoding_are_named(tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / "a.db3") as database:
        database.execute("CREATE TABLE people(name TEXT)")
    with pytest.raises(
        RecordingError, match=r"a\.db3: is not a readable sqlite3 bag of rosbag2 \(no such table: topics"
    ):
        read_recording(tmp_path / "a.db3")
    path = db3_file(vicon_and_ur(), tmp_path / "lab")
    with sqlite3.connect(path) as database:
        database.execute("UPDATE topics SET serialization_format = 'xml' WHERE name = ?", (UR,))
    with pytest.raises(RecordingError, match=f"pusher_topic '{UR}' .*no such topic; the bag contains .*{VICON}"):
        read_recording(path, topics=NAMES)
    assert any(f"{UR} is encoded as 'xml', cdr is accepted" in note for note in open_bag(path).notes)


def test_cells_of_another_type_are_skipped_with_a_note(tmp_path: Path) -> None:
    path = db3_file(vicon_and_ur(), tmp_path / "lab")
    with sqlite3.connect(path) as database:
        for row, change in enumerate(("data = 7", "timestamp = -1", "data = 'text'"), start=1):
            database.execute(f"UPDATE messages SET {change} WHERE id = {10 * row}")
        database.execute("UPDATE topics SET type = x'ff00' WHERE name = '/netft'")
    found = read_recording(path, topics=replace(NAMES, wrench=""))
    lost = len(original().slider) + len(original().pusher) - len(found.slider) - len(found.pusher)
    assert any(f"{lost} messages cannot be read or decompressed" in note for note in found.notes) and lost > 0
    assert any("has no readable name or type; its messages were skipped" in note for note in found.notes)


def test_a_missing_package_is_named_with_its_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = bag_file(vicon_and_ur(), tmp_path / "lab")
    other = db3_file(vicon_and_ur(), tmp_path / "other")
    monkeypatch.setitem(sys.modules, "rosbags.rosbag1", None)
    with pytest.raises(RecordingError, match=r"lab\.bag: ROS 1 bags need the package rosbags \(pip install rosbags\)"):
        read_recording(path, topics=NAMES)
    assert len(read_recording(other, topics=NAMES).slider) == len(original().slider)  # sqlite3 is part of Python


def test_a_rig_in_the_metadata_of_a_db3_folder_is_read(tmp_path: Path) -> None:
    import yaml

    path = write_db3(vicon_and_ur(), tmp_path / "lab")
    information = yaml.safe_load((path / "metadata.yaml").read_text())
    assert original().rig is not None
    information["rosbag2_bagfile_information"]["custom_data"] = original().rig.to_record()
    (path / "metadata.yaml").write_text(yaml.safe_dump(information))
    assert_same_windows(replace(read_recording(path, topics=NAMES), name="lab"))


def test_a_damaged_name_in_the_tables_of_a_db3_file_is_refused_in_one_line(tmp_path: Path) -> None:
    path = db3_file(vicon_and_ur(), tmp_path / "lab")
    before, found, after = path.read_bytes().rpartition(b"KEY,\n      name TEXT NOT NULL,\n      type")
    assert found
    path.write_bytes(before + b"\xf1" + found[1:] + after)
    with pytest.raises(RecordingError, match="is not a readable sqlite3 bag of rosbag2"):
        open_bag(path)

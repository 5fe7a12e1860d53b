# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The recorder without ROS: the bag that it writes, what it finds in it while recording, and what it calls missing."""

from __future__ import annotations

import resource
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from lab_bags import Lab, pose_rows, short_recording
from mcap.reader import make_reader
from repository import REPOSITORY
from turning_sensor import add_tip, add_wrench, measured_at_mount, sensor_tf

from push_predictor.errors import RecordingError
from push_predictor.online.live_recording import NO_RIG, LiveRecording
from push_predictor.online.recorder_progress import Progress
from push_predictor.recordings.bag.metadata import TopicInfo
from push_predictor.recordings.bag.reader import Bag, RawMessage, open_bag
from push_predictor.recordings.bag.writer import LIVE_CHUNK_SIZE, BagWriter
from push_predictor.recordings.fields.pose_rows import composed, inverted, normalised
from push_predictor.recordings.load import load_rig_for
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.topics import Topics, load_topics
from push_predictor.recordings.windows.finder import find_windows

HEXAGON = REPOSITORY / "bags" / "hexagon_delrin"
TEMPERATURE = "/surface/temperature"
PORTION = 10**9  # ns of log time between two calls of work()
STREAMS = Topics("/slider/pose", "/pusher/pose", "/pusher/wrench", (TEMPERATURE,))


@pytest.fixture(scope="module")
def source() -> Bag:
    return open_bag(HEXAGON)


@pytest.fixture(scope="module")
def messages(source: Bag) -> list[RawMessage]:
    return list(source.messages())


@pytest.fixture(scope="module")
def rig() -> Rig:
    return load_rig_for([HEXAGON])


def recorder(path: Path, topics: Topics = STREAMS, **more: bool) -> LiveRecording:
    return LiveRecording(path, topics, 0.0, **more)


def feed(recording: LiveRecording, messages: list[RawMessage], work: bool = True) -> float:
    """Record messages as they were logged, in portions; returns the time (s) since the first."""
    for topic, kind in {message.topic: message.type for message in messages}.items():
        if not recording.type_of(topic):
            recording.add_topic(TopicInfo(topic, kind, 0, "RIHS01_x", reliability="best_effort"))
    begin, portion = messages[0].log_time, 0
    for message in messages:
        if (message.log_time - begin) // PORTION > portion and work:
            portion = (message.log_time - begin) // PORTION
            recording.work(float(portion))
        recording.write(message.topic, message.log_time, message.data)
    return (messages[-1].log_time - begin) * 1e-9


@pytest.fixture(scope="module")
def recorded(
    messages: list[RawMessage], rig: Rig, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Progress, Progress]:
    """A bag, its progress before the end, and its summary."""
    path = tmp_path_factory.mktemp("recorded") / "monday"
    recording = recorder(path)
    recording.set_rig(rig)
    now = feed(recording, messages)
    before = recording.progress(now)
    return path, before, recording.close(now)


# --- the bag ---------------------------------------------------------------------------------------------------------


def test_the_bag_has_every_message_unchanged_and_the_rig(
    recorded: tuple[Path, Progress, Progress], messages: list[RawMessage], source: Bag
) -> None:
    bag = open_bag(recorded[0])
    assert list(bag.messages()) == messages and not bag.notes
    assert bag.metadata["push_rig"] == source.metadata["push_rig"]


def test_windows_so_far_are_those_of_the_bag(recorded: tuple[Path, Progress, Progress], rig: Rig) -> None:
    path, before, summary = recorded
    windows = find_windows(read_recording(path), rig)
    assert summary.windows == len(windows) and summary.pushes == len({window.push_id for window in windows})
    assert before.windows is not None and 0.8 * len(windows) < before.windows <= len(windows)
    assert summary.contact is not None and 0.5 < summary.contact < 0.8


def test_figures_are_those_of_the_streams(recorded: tuple[Path, Progress, Progress]) -> None:
    path, _, summary = recorded
    streams = {each.name: each for each in summary.streams}
    recording = read_recording(path)
    assert list(streams) == ["slider", "pusher", "wrench", TEMPERATURE]
    for name, stream in (("slider", recording.slider), ("pusher", recording.pusher), ("wrench", recording.wrench)):
        assert stream is not None
        assert streams[name].samples == len(stream)
        assert streams[name].largest_gap == pytest.approx(np.diff(stream.stamp).max() * 1e-9)
        assert streams[name].rate == pytest.approx((len(stream) - 1) / (np.ptp(stream.stamp) * 1e-9))
    assert streams[TEMPERATURE].rate == pytest.approx(2.0, rel=0.01)
    assert summary.seconds == pytest.approx(18.77, abs=0.05) and not summary.problems


def test_the_mcap_library_reads_definitions_and_times(recorded: tuple[Path, Progress, Progress]) -> None:
    with (recorded[0] / "monday_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        assert summary.statistics.message_count == sum(recorded[2].messages.values())
        assert len(summary.chunk_indexes) > 5, "chunks are small, so that a killed process loses little"
        schemas = {schema.name: schema.data.decode() for schema in summary.schemas.values()}
        assert "MSG: geometry_msgs/Quaternion" in schemas["geometry_msgs/msg/PoseStamped"]
        assert [record.name for record in reader.iter_metadata()] == ["push_rig"]


def test_the_metadata_have_the_qos_of_the_publishers(recorded: tuple[Path, Progress, Progress]) -> None:
    content = yaml.safe_load((recorded[0] / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    for topic in content["topics_with_message_count"]:
        described = topic["topic_metadata"]
        assert described["offered_qos_profiles"][0]["reliability"] == "best_effort"
        assert described["type_description_hash"] == "RIHS01_x"
        assert topic["message_count"] == recorded[2].messages[described["name"]]


def test_the_topics_are_saved_next_to_the_bag_without_those_that_are_not_in_it(
    messages: list[RawMessage], tmp_path: Path
) -> None:
    poses = [message for message in messages if "pose" in message.topic][:300]
    recording = recorder(tmp_path / "a", replace(STREAMS, covariates=("/nowhere", "/slider/pose.pose.position.z")))
    feed(recording, poses)
    recording.close(3.0)
    saved = load_topics(tmp_path / "a")
    assert saved == Topics("/slider/pose", "/pusher/pose", covariates=("/slider/pose.pose.position.z",))
    assert read_recording(tmp_path / "a").wrench is None


def test_a_topic_that_appears_later_is_in_the_bag_and_in_the_saved_topics(
    messages: list[RawMessage], tmp_path: Path
) -> None:
    recording = recorder(tmp_path / "a")
    feed(recording, [message for message in messages if "pose" in message.topic][:100])
    feed(recording, [message for message in messages if message.topic == TEMPERATURE][:3])
    recording.close(1.0)
    assert load_topics(tmp_path / "a").covariates == (TEMPERATURE,)
    assert len(read_recording(tmp_path / "a").scalars[TEMPERATURE]) == 3


def test_a_killed_recorder_leaves_all_but_the_last_chunk(messages: list[RawMessage], rig: Rig, tmp_path: Path) -> None:
    recording = recorder(tmp_path / "a")
    recording.set_rig(rig)
    feed(recording, messages, work=False)
    recording.work(20.0)  # and then nothing more: neither the end of the file nor metadata.yaml is written
    assert not (tmp_path / "a" / "metadata.yaml").exists()
    bag = open_bag(tmp_path / "a")
    found = list(bag.messages())
    assert found == messages[: len(found)]
    lost = sum(len(message.data) + 31 for message in messages[len(found) :])
    assert 0 < lost <= LIVE_CHUNK_SIZE
    assert any("end of the file is missing" in note for note in bag.notes)
    assert len(find_windows(read_recording(tmp_path / "a"), load_rig_for([tmp_path / "a"]))) > 40


def test_a_single_file_is_a_bag_too(messages: list[RawMessage], tmp_path: Path) -> None:
    recording = recorder(tmp_path / "a.mcap")
    feed(recording, messages[:500])
    assert recording.close(2.0).started
    assert list(open_bag(tmp_path / "a.mcap").messages()) == messages[:500]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap", "a.recording.yaml"]


def test_without_a_message_nothing_is_written_and_an_earlier_bag_stays(
    messages: list[RawMessage], tmp_path: Path
) -> None:
    feed(first := recorder(tmp_path / "a"), messages[:50])
    first.close(1.0)
    before = sorted((path.name, path.stat().st_mtime_ns) for path in (tmp_path / "a").iterdir())
    summary = recorder(tmp_path / "a").close(1.0)
    assert "No message arrived. No bag was written." in summary.to_text() and summary.to_json()["recording"] is None
    assert sorted((path.name, path.stat().st_mtime_ns) for path in (tmp_path / "a").iterdir()) == before


def test_the_first_message_replaces_an_earlier_bag(messages: list[RawMessage], tmp_path: Path) -> None:
    for count in (50, 20):
        feed(recording := recorder(tmp_path / "a"), messages[:count])
        recording.close(1.0)
    assert list(open_bag(tmp_path / "a").messages()) == messages[:20]


def test_a_folder_that_is_no_bag_is_not_touched(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("no copy")
    with pytest.raises(RecordingError, match="is not a bag"):
        recorder(tmp_path)


def test_a_live_bag_is_completed_after_an_error(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), BagWriter(tmp_path / "a", live=True) as writer:
        writer.add_topic("/x", "std_msgs/msg/Float64", "float64 data\n")
        writer.write("/x", 5, b"\0\1\0\0" + bytes(8))
        raise ZeroDivisionError
    bag = open_bag(tmp_path / "a")
    assert len(list(bag.messages())) == 1 and not bag.notes


def test_a_full_disk_is_an_error_that_names_the_bag_and_what_was_written_stays(
    messages: list[RawMessage], tmp_path: Path
) -> None:
    recording = recorder(tmp_path / "a.mcap")
    feed(recording, messages[:1000])
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, limits[1]))
    try:
        with pytest.raises(RecordingError, match=r"a\.mcap: cannot be written \(File too large\)"):
            feed(recording, messages[1000:])
        with pytest.raises(RecordingError, match=r"a\.mcap: cannot be written"):
            recording.close(1.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    found = list(open_bag(tmp_path / "a.mcap").messages())
    assert len(found) > 500 and found == messages[: len(found)]


def test_the_last_window_counts_when_the_recording_ends_in_a_push(
    messages: list[RawMessage], rig: Rig, tmp_path: Path
) -> None:
    window = find_windows(read_recording(HEXAGON), rig)[5]
    recording = recorder(tmp_path / "a")
    recording.set_rig(rig)
    feed(recording, [message for message in messages if message.log_time < window.end + 15_000_000])
    assert recording.close(9.0).windows == len(find_windows(read_recording(tmp_path / "a"), rig)) == 6


def test_whole_chunks_are_on_the_disk_after_each_call(tmp_path: Path) -> None:
    recording = recorder(tmp_path / "a", replace(STREAMS, covariates=("/image",)))
    empty = b"\0\1\0\0" + bytes(2 * LIVE_CHUNK_SIZE)  # a chunk that is compressed to less than Python's file buffer
    feed(recording, [RawMessage("/image", "std_msgs/msg/String", 5, empty)])
    recording.work(1.0)
    assert [len(message.data) for message in open_bag(tmp_path / "a").messages()] == [len(empty)]


# --- what is missing -------------------------------------------------------------------------------------------------


def problems(recording: LiveRecording, now: float) -> list[str]:
    return list(recording.progress(now).problems.values())


def test_a_missing_rig_is_a_problem_until_it_comes(messages: list[RawMessage], rig: Rig, tmp_path: Path) -> None:
    recording = recorder(tmp_path / "a")
    half = len(messages) // 2
    feed(recording, messages[:half])
    assert NO_RIG in problems(recording, 0.0) and recording.progress(0.0).windows is None
    recording.set_rig(rig)
    feed(recording, messages[half:])
    summary = recording.close(20.0)
    assert not summary.problems and summary.windows == len(find_windows(read_recording(tmp_path / "a"), rig))
    assert read_recording(tmp_path / "a").rig is not None


def test_another_rig_is_a_problem_and_the_first_stays(rig: Rig, tmp_path: Path) -> None:
    recording = recorder(tmp_path / "a")
    recording.set_rig(rig)
    recording.set_rig(replace(rig))
    assert "rig" not in recording.progress(0.0).problems
    recording.set_rig(replace(rig, pusher_radius=0.01))
    assert "another rig" in recording.progress(0.0).problems["rig"]


def test_topics_without_publisher_or_message_are_named(messages: list[RawMessage], tmp_path: Path) -> None:
    recording = recorder(tmp_path / "a", Topics("/slider/pose", "/pusher/pose", "/pusher/wrench"), with_wrench=False)
    recording.set_published("/slider/pose", False)
    recording.set_published("/pusher/pose", True)
    recording.set_published("/pusher/wrench", False)
    assert problems(recording, 1.0) == [NO_RIG, "No publisher of /slider/pose."]
    assert problems(recording, 4.0) == [NO_RIG, "No publisher of /slider/pose.", "No message on /pusher/pose for 4 s."]
    recording.set_published("/slider/pose", True)
    feed(recording, [message for message in messages if message.topic == "/slider/pose"][:200])
    recording.work(5.0)
    assert problems(recording, 6.0) == [NO_RIG, "No message on /pusher/pose for 6 s."]
    assert "No message on /slider/pose for 4 s." in problems(recording, 9.0)
    recording.set_published("/slider/pose", False)
    assert list(recording.close(9.0).problems.values()) == [NO_RIG, "No message on /pusher/pose."]


def test_an_optional_wrench_is_missed_only_once_it_was_there(messages: list[RawMessage], tmp_path: Path) -> None:
    recording = recorder(tmp_path / "a", Topics("/slider/pose", "/pusher/pose", "/pusher/wrench"), with_wrench=False)
    assert "/pusher/wrench" not in " ".join(problems(recording, 9.0))
    feed(recording, [message for message in messages if message.topic == "/pusher/wrench"][:50])
    recording.work(10.0)
    assert "No message on /pusher/wrench for 5 s." in problems(recording, 15.0)


def test_a_noted_problem_replaces_the_silence_of_its_topic(tmp_path: Path) -> None:
    recording = recorder(tmp_path / "a")
    recording.note("/pusher/pose", "/pusher/pose is not recorded: type x is not installed.")
    found = problems(recording, 9.0)
    assert "/pusher/pose is not recorded: type x is not installed." in found
    assert not any("No message on /pusher/pose" in text for text in found)
    recording.note("/pusher/pose", "")
    assert "No message on /pusher/pose for 9 s." in problems(recording, 9.0)


def test_the_static_topic_of_tf_may_lose_its_publisher(tmp_path: Path) -> None:
    recording = recorder(tmp_path / "a", Topics("/tf:block", "/tf:tool0"), with_wrench=False)
    recording.add_topic(TopicInfo("/tf_static", "tf2_msgs/msg/TFMessage", 0))
    recording.write("/tf_static", 5, b"\0\1\0\0" + bytes(4))
    recording.set_published("/tf_static", False)
    assert not any("publisher of /tf_static" in text for text in problems(recording, 1.0))


def test_lost_messages_are_counted(messages: list[RawMessage], tmp_path: Path) -> None:
    recording = recorder(tmp_path / "a")
    feed(recording, messages[:9])
    recording.write("/slider/pose", messages[9].log_time, messages[9].data, lost=3)
    recording.write("/slider/pose", messages[9].log_time, messages[9].data, lost=1)
    assert "/slider/pose: 4 messages were lost before they arrived." in problems(recording, 1.0)


def test_a_type_that_has_no_pose_is_recorded_and_named(messages: list[RawMessage], tmp_path: Path) -> None:
    recording = recorder(tmp_path / "a", Topics("/joint_states", "/pusher/pose"))
    recording.add_topic(TopicInfo("/joint_states", "sensor_msgs/msg/JointState", 0))
    recording.write("/joint_states", 5, b"\0\1\0\0" + bytes(40))
    recording.work(1.0)
    assert any("take it from /tf and /tf_static" in text for text in problems(recording, 1.0))
    assert recording.close(2.0).messages["/joint_states"] == 1


def test_rejected_samples_are_counted_by_their_fault(messages: list[RawMessage], tmp_path: Path) -> None:
    recording = recorder(tmp_path / "a")
    poses = [message for message in messages if message.topic == "/slider/pose"][:5]
    feed(recording, poses)
    recording.write("/slider/pose", poses[-1].log_time, b"\0\1\0\0")
    recording.work(1.0)
    assert "/slider/pose: 1 samples were rejected (unreadable 1)." in problems(recording, 1.0)


def test_a_type_without_installed_definition_is_recorded_and_named(tmp_path: Path) -> None:
    recording = recorder(tmp_path / "a", replace(STREAMS, covariates=("/current",)))
    recording.add_topic(TopicInfo("/current", "lab_msgs/msg/Current", 0))
    recording.write("/current", 5, b"\0\1\0\0" + bytes(8))
    assert any("lab_msgs/msg/Current.msg: not found" in text for text in problems(recording, 1.0))
    recording.close(1.0)
    assert [message.type for message in open_bag(tmp_path / "a").messages()] == ["lab_msgs/msg/Current"]


# --- other types -----------------------------------------------------------------------------------------------------


def test_an_unknown_frame_is_named_with_the_known_ones(tmp_path: Path) -> None:
    whole, lab = short_recording(2.0), Lab()
    lab.transform("/tf", "world", "tool0", whole.pusher.stamp, pose_rows(whole.pusher))
    recording = recorder(tmp_path / "a", Topics("/tf:block", "/tf:tool0"))
    feed(recording, [RawMessage(topic, lab.kinds[topic], t, data) for t, topic, data in lab.in_order()])
    assert any("no frame 'block'; the frames are tool0, world" in text for text in problems(recording, 1.0))


def test_what_readers_do_with_the_wrench_is_saved(messages: list[RawMessage], tmp_path: Path) -> None:
    given = Topics("/slider/pose", "/pusher/pose", wrench_frame="tip", wrench_bias="free_motion", world="map")
    recording = recorder(tmp_path / "a", given)
    feed(recording, messages[:9])
    recording.close(1.0)
    saved = load_topics(tmp_path / "a")
    assert (saved.wrench_frame, saved.wrench_bias, saved.world) == ("tip", "free_motion", "map")


# --- what it finds ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bias", ["none", "free_motion"])
def test_windows_so_far_are_of_the_frames_and_axes_that_readers_use(tmp_path: Path, bias: str) -> None:
    """A slider seen by a tracker elsewhere, a tip in tf, and a biased sensor on a frame above it."""
    whole = short_recording(6.0)
    assert whole.wrench is not None and whole.rig is not None
    table = normalised(np.array([[0.4, -0.2, 0.1, 0.0, 0.0, 0.6, 0.8]]))
    lab = Lab(frame="tracker")
    seen = composed(inverted(np.repeat(table, len(whole.slider), axis=0)), pose_rows(whole.slider))
    add_tip(lab, "/slider", whole.slider.stamp, seen)
    lab.transform("/tf_static", "world", "tracker", whole.slider.stamp[:1], table)
    sensor_tf(lab, whole.pusher, table)
    add_wrench(lab, "/ft", whole.wrench.stamp, measured_at_mount(whole.wrench, whole.pusher) + 0.3, "ft")
    topics = Topics("/slider", "/tf:tool0", "/ft", wrench_frame="ft", wrench_bias=bias, world="world")
    recording = recorder(tmp_path / "a", topics)
    recording.set_rig(whole.rig)
    feed(recording, [RawMessage(topic, lab.kinds[topic], sent, data) for sent, topic, data in lab.in_order()])
    summary = recording.close(7.0)
    windows = find_windows(read_recording(tmp_path / "a"), whole.rig)
    assert not summary.problems and summary.windows is not None and len(windows) > 10
    # With free motion the bias is that so far, which may change a window.
    assert abs(summary.windows - len(windows)) <= (bias == "free_motion")

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Damaged bags: data before the damage are used, the damage is noted, and time and memory stay bounded."""

from __future__ import annotations

import os
import re
import struct
import subprocess
import sys
import tracemalloc
import zlib
from collections.abc import Iterable
from pathlib import Path
from random import Random

import pytest
import zstandard
from mcap.writer import CompressionType, Writer
from replay_bags import POSE, RIG, START, push_messages, stamped, write_bag
from repository import REPOSITORY

from benchmarks.recordings import fuzz_bags
from push_predictor.cli import main
from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.recordings.read import read_recording

KINDS, FORMS = 15, 9  # of damage, of bags; copy n has kind n % KINDS, and the form after KINDS copies is the next one
COPIES = [KINDS * (kind % FORMS) + kind for kind in range(KINDS)]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Four seconds of poses and forces in some ten chunks of 64 kB, with a rig and a summary."""
    return write_bag(tmp_path_factory.mktemp("bags") / "bag.mcap", push_messages(4.0)).read_bytes()


@pytest.fixture
def bag(written: bytes, tmp_path: Path) -> Path:
    """A copy to be damaged."""
    (path := tmp_path / "bag.mcap").write_bytes(written)
    return path


def chunks_of(data: bytes) -> list[int]:
    """The offsets of the chunks."""
    found, at = [], 8
    while at + 9 < len(data) and data[at] != 15:
        found += [at] if data[at] == 6 else []
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    return found


def messages_and_notes(bag: Path) -> tuple[list[bytes], list[str]]:
    """The messages and the notes."""
    opened = open_bag(bag)
    return [m.data for m in opened.messages()], opened.notes


def write_messages(path: Path, topic: str, messages: Iterable[bytes], **options: object) -> int:
    """Write messages of one topic, a nanosecond apart; returns the offset of the end of the data without chunks."""
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile="ros2")
        channel = writer.register_channel(topic, "cdr", writer.register_schema(POSE, "ros2msg", b""))
        for step, data in enumerate(messages):
            writer.add_message(channel, START + step, data, START + step)
        end = stream.tell()
        writer.finish()
    return end


def poses(count: int) -> list[bytes]:
    """Messages of a slider that moves along x."""
    return [stamped(START + step, [step, 0, 0, 0, 0, 0, 1]) for step in range(count)]


@pytest.mark.slow
def test_damaged_copies_are_read_as_far_as_they_are_intact(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Every kind of damage, each in another form of bag, which the mcap package wrote.

    The long form: 2000 copies.
    """
    monkeypatch.setattr(sys, "argv", ["fuzz_bags", "--seed", "6", "--only", *map(str, COPIES)])
    status, printed = fuzz_bags.main(), capfd.readouterr().out
    assert status == 0, printed
    assert re.search(rf"^{len(COPIES)} copies of {FORMS} bags in .*, 0 failed$", printed, re.MULTILINE)


@pytest.mark.parametrize("length", [1 << 31, (1 << 64) - 1, 300_000], ids=["2 GB", "2^64", "300 kB"])
@pytest.mark.parametrize("summary", [True, False], ids=["summary", "no summary"])
def test_chunk_with_an_excessive_length_is_noted_and_uses_no_memory(bag: Path, length: int, summary: bool) -> None:
    """With this length the rest of the file would be one chunk; reading continues at the next one."""
    data = bytearray(bag.read_bytes())
    whole, _ = messages_and_notes(bag)
    chunks = chunks_of(data)
    struct.pack_into("<Q", data, chunks[2] + 1, length)
    bag.write_bytes(data if summary else data[:-200])
    tracemalloc.start()
    opened = open_bag(bag)
    count = sum(1 for _ in opened.messages())
    held = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    messages = messages_and_notes(bag)[0]
    assert messages[:900] == whole[:900]
    assert len(whole) * 0.75 < count < len(whole)
    assert any(f"bag.mcap at byte {chunks[2]}: " in note for note in opened.notes)
    assert held < 2 * 64_000 + 130_000


def test_chunk_that_states_too_much_content_is_skipped(bag: Path) -> None:
    data = bytearray(bag.read_bytes())
    chunk = chunks_of(data)[1]
    whole = len(messages_and_notes(bag)[0])
    struct.pack_into("<Q", data, chunk + 25, 1 << 31)
    bag.write_bytes(data)
    found, notes = messages_and_notes(bag)
    assert any(f"at byte {chunk}: a chunk was skipped: a chunk of {1 << 31} bytes" in note for note in notes)
    assert any(f"{len(found)} messages were found, the summary lists {whole}" in note for note in notes)


@pytest.mark.parametrize("place", range(65_480, 65_560, 13))
def test_a_chunk_is_found_wherever_it_begins(bag: Path, place: int) -> None:
    """Also where the part of the file that is searched at once ends."""
    data = bag.read_bytes()
    first = chunks_of(data)[0]
    bag.write_bytes(data[:first] + bytes(place) + data[first:])
    found, _ = messages_and_notes(bag)
    bag.write_bytes(data)
    assert found == messages_and_notes(bag)[0]


@pytest.mark.parametrize("change", [-300, 300], ids=["lost", "added"])
@pytest.mark.parametrize("summary", [True, False], ids=["summary", "no summary"])
def test_chunks_after_lost_or_added_bytes_are_used(bag: Path, change: int, summary: bool) -> None:
    """They are not where the summary lists them."""
    data = bag.read_bytes()
    whole, _ = messages_and_notes(bag)
    chunk = chunks_of(data)[2]
    changed = data[: chunk + 500] + bytes(max(change, 0)) + data[chunk + 500 + max(-change, 0) :]
    bag.write_bytes(changed if summary else changed[:-200])
    found, notes = messages_and_notes(bag)
    assert 0.75 * len(whole) < len(found) < len(whole)
    assert found == [message for message in whole if message in set(found)]
    assert any(
        re.search(rf"at byte {chunk}: a chunk was skipped: .* \([\d.]+ s of messages\)$", note) for note in notes
    )


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_chunk_larger_than_stated_is_rejected_before_decompression(bag: Path, compression: str) -> None:
    import lz4.frame

    data = bytearray(bag.read_bytes())
    chunk, end = chunks_of(data)[1:3]
    pack = zstandard.compress if compression == "zstd" else lz4.frame.compress
    bomb = pack(bytes(1 << 23))
    name = compression.encode()
    content = data[chunk + 9 : chunk + 37] + struct.pack("<I", len(name)) + name + struct.pack("<Q", len(bomb)) + bomb
    bag.write_bytes(data[:chunk] + struct.pack("<BQ", 6, len(content)) + content + data[end:])
    tracemalloc.start()
    messages, notes = messages_and_notes(bag)
    held = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(messages) > 1000
    assert any(f"at byte {chunk}: a chunk was skipped: a chunk does not contain the " in note for note in notes)
    assert held < 1 << 21  # with the messages that this test keeps


HELD = """
import sys
from pathlib import Path
from push_predictor.recordings.bag.reader import open_bag
def most():
    return 1024 * int(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0])
sum(1 for _ in open_bag(Path(sys.argv[1])).messages())  # which takes memory once
before = most()
sum(1 for _ in open_bag(Path(sys.argv[2])).messages())
print(most() - before)
"""


@pytest.mark.parametrize(("compression", "noise"), [(CompressionType.ZSTD, 4000), (CompressionType.LZ4, 500)])
def test_reading_uses_the_memory_of_at_most_two_chunks(
    bag: Path, tmp_path: Path, compression: CompressionType, noise: int
) -> None:
    path, chunk, rng = tmp_path / "noise.mcap", 1 << 23, Random(0)
    messages = (rng.randbytes(noise) + bytes(4000 - noise) for _ in range(6000))
    write_messages(path, "/noise", messages, chunk_size=chunk, compression=compression)
    grown = subprocess.run([sys.executable, "-c", HELD, bag, path], check=True, cwd=REPOSITORY, capture_output=True)
    print(int(grown.stdout) / chunk)
    assert int(grown.stdout) < 2.1 * chunk  # what the whole process grew by at most; noise of a megabyte


def test_messages_of_a_truncated_chunk_are_used(bag: Path) -> None:
    """zstd decompresses in blocks of 128 kB: of a chunk with several, those before the cut are used."""
    messages = [os.urandom(500) for _ in range(2000)]
    write_messages(bag, "/camera", messages, compression=CompressionType.ZSTD, chunk_size=2_000_000)
    bag.write_bytes(bag.read_bytes()[:700_000])
    found, notes = messages_and_notes(bag)
    assert 1000 < len(found) < 1400
    assert found == messages[: len(found)]
    assert any("damaged or cut off" in note for note in notes)
    assert not any("a record cannot be read" in note for note in notes)


def test_chunk_with_missing_bytes_is_not_treated_as_truncated(bag: Path) -> None:
    """So many that it extends beyond the end of the file: what follows the gap is not a message."""
    write_messages(bag, "/slider/pose", poses(400), compression=CompressionType.NONE)
    whole, _ = messages_and_notes(bag)
    data = bag.read_bytes()
    bag.write_bytes(data[:10_000] + data[30_011:])
    found, notes = messages_and_notes(bag)
    assert set(found) <= set(whole)
    assert any("damaged or cut off" in note for note in notes)


def test_zeros_at_the_end_lose_no_message_before_them(bag: Path) -> None:
    """Also without chunks: the last message is complete, although no record follows it."""
    end = write_messages(bag, "/slider/pose", poses(100), use_chunking=False)
    data = bag.read_bytes()
    bag.write_bytes(data[:end] + bytes(5000))
    found, notes = messages_and_notes(bag)
    assert len(found) == 100
    assert any(f"at byte {end}, is damaged" in note for note in notes)


def test_a_message_shorter_than_its_own_header_is_noted_and_those_before_it_are_used(bag: Path) -> None:
    write_messages(bag, "/slider/pose", poses(100), compression=CompressionType.NONE, enable_crcs=False)
    whole, _ = messages_and_notes(bag)
    data = bytearray(bag.read_bytes())
    struct.pack_into("<Q", data, data.index(whole[40]) - 30, 10)  # the length, before the 22 bytes of the header
    bag.write_bytes(data)
    found, notes = messages_and_notes(bag)
    assert found == whole[:40]
    assert any("a message has 10 bytes, its header alone needs 22" in note for note in notes)


@pytest.mark.parametrize("what", ["type", "encoding"])
def test_messages_before_a_foreign_schema_or_encoding_are_used(bag: Path, what: str) -> None:
    with bag.open("wb") as stream:
        writer = Writer(stream, chunk_size=2000)
        writer.start(profile="ros2")
        good = writer.register_schema(POSE, "ros2msg", b"")
        foreign = good if what == "encoding" else writer.register_schema("my_msgs/msg/Pose", "ros2msg", b"float32 x")
        slider = [
            writer.register_channel("/slider/pose", "cdr", good),
            writer.register_channel("/slider/pose", "json" if what == "encoding" else "cdr", foreign),
        ]
        pusher = writer.register_channel("/pusher/pose", "cdr", good)
        for step in range(100):
            data = stamped(START + step, [step, 0, 0, 0, 0, 0, 1])
            writer.add_message(slider[step >= 50], START + step, data, 0)
            writer.add_message(pusher, START + step, data, 0)
        writer.finish()
    read = read_recording(bag)
    assert (len(read.slider), len(read.pusher)) == (50, 100)
    expected = "50 messages have type 'my_msgs/msg/Pose'" if what == "type" else "/slider/pose is encoded as 'json'"
    assert any("/slider/pose" in note and expected in note for note in read.notes)


def test_damaged_summary_is_noted_and_ignored(bag: Path) -> None:
    """A summary is used if its checksum is correct and it directly follows the data."""
    data = bytearray(bag.read_bytes())
    whole, _ = messages_and_notes(bag)
    start, _, _ = struct.unpack_from("<QQI", data, len(data) - 28)
    at = data.index(b"/slider/pose", start)
    data[at : at + 12] = b"/slider/posf"
    bag.write_bytes(data)
    messages, notes = messages_and_notes(bag)
    assert messages == whole
    assert any(f"at byte {start}: the summary's checksum is wrong" in note for note in notes)
    assert set(open_bag(bag).topics) == {"/slider/pose", "/pusher/pose", "/pusher/wrench"}


@pytest.mark.parametrize("lie", [100, 70_000, 1 << 40, (1 << 64) - 1])
def test_wrong_metadata_index_is_noted_and_the_record_is_found(bag: Path, lie: int) -> None:
    """The checksum is correct: a faulty or malicious program wrote the file."""
    data = bytearray(bag.read_bytes())
    start, _, _ = struct.unpack_from("<QQI", data, len(data) - 28)
    place = data.rindex(b"push_rig") - 29  # opcode, length, offset, length, length of the name
    struct.pack_into("<Q", data, place + 9, lie)
    struct.pack_into("<I", data, len(data) - 12, zlib.crc32(data[start:-12]))
    bag.write_bytes(data)
    opened = open_bag(bag)
    assert dict(opened.metadata["push_rig"]) == RIG
    assert any(f"at byte {lie}: " in note and "metadata" in note for note in opened.notes)


def test_checksum_of_the_data_is_verified_if_present(tmp_path: Path) -> None:
    path = tmp_path / "sum.mcap"
    end = write_messages(path, "/slider/pose", poses(100), use_chunking=False, enable_data_crcs=True)
    assert messages_and_notes(path)[1] == []
    data = bytearray(path.read_bytes())
    data[end - 20] ^= 1
    path.write_bytes(data)
    messages, notes = messages_and_notes(path)
    assert len(messages) == 100
    assert notes == [f"{path} at byte {end}: the checksum of the data is wrong; they are damaged somewhere before it"]


def test_other_files_are_used_if_one_is_damaged(tmp_path: Path) -> None:
    folder = tmp_path / "split"
    folder.mkdir()
    for part in range(4):
        write_bag(folder / f"split_{part}.mcap", push_messages(0.4))
    whole = len(messages_and_notes(folder)[0]) // 4
    (folder / "split_0.mcap").write_bytes(b"")
    (folder / "split_1.mcap").write_bytes(b"no MCAP at all")
    (folder / "split_2.mcap").write_bytes((folder / "split_2.mcap").read_bytes()[:60])
    messages, notes = messages_and_notes(folder)
    assert len(messages) == whole
    assert any("split_0.mcap: the file is empty" in note and "the other files are used" in note for note in notes)
    assert any("split_1.mcap: not an MCAP file" in note for note in notes)
    assert any(re.search(r"split_2\.mcap at byte \d+", note) for note in notes)
    (folder / "split_2.mcap").unlink()
    (folder / "split_3.mcap").unlink()
    with pytest.raises(RecordingError, match=r"split_0\.mcap: the file is empty"):
        open_bag(folder)


def test_file_with_damage_everywhere_is_read_in_bounded_time_with_bounded_notes(tmp_path: Path) -> None:
    """Every message is on a channel without description; one note per message would be too slow."""
    record = struct.pack("<BQHIQQ", 5, 22 + 4, 7, 0, 0, 0) + b"\0\1\0\0"
    path = tmp_path / "wild.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + 10_000 * record)
    messages, notes = messages_and_notes(path)
    assert messages == []
    assert len(notes) < 100
    assert notes[-1] == f"{path}: further damage is not listed"


def test_commands_on_damaged_bags_exit_with_0_or_1_and_one_line(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = bag.read_bytes()
    model = str(REPOSITORY / "resource" / "simulated_square_abs.pushmodel")
    for content in (data[:40_000], data[:100], b"", b"x", data[:30_000] + bytes(9000) + data[39_000:]):
        bag.write_bytes(content)
        validate = [["validate", model, str(bag)]] if len(content) in (0, 40_000) else []
        for command in (["info", str(bag)], *validate):
            status = main(command)
            out, err = capsys.readouterr()
            lines = [line for line in err.splitlines() if not line.startswith("warning:")]
            assert (status, len(lines)) in ((0, 0), (1, 1)), err
            if command[0] == "info" and len(content) > 1000:
                assert status == 0 and "bag.mcap at byte" in out

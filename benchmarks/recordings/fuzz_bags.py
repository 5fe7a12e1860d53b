# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Read damaged copies of bags: is all data before the damage used, the damage named, memory and time small?

    python -m benchmarks.recordings.fuzz_bags [--copies 2000] [--seed 0] [--only NUMBER...]

A forked process reads each copy. A copy fails if

- a message before the damage is missing, or, where the bag has checksums, a message was never recorded;
- messages are missing or differ, and no note names the file and a byte from the start of the damaged record or chunk to
  its end. Exceptions: without checksums a flipped bit in a message cannot be detected, and without a summary neither
  can a chunk that was cleanly removed;
- Python allocates more than twice the bag's largest chunk and 128 kB (tracemalloc, during messages()), or the process
  grows by more than 16 MB (ru_maxrss, which includes C libraries and fluctuates by some MB);
- reading, or the reading of `push_predictor info` after it, takes more than 2 s of processor time or 60 s of wall time,
  crashes, or ends with an error other than those that the command line prints as one line.

Prints a table by kind of damage and the failed copies, each with the command that reproduces it. The exit status is 1
if there are any.
"""

from __future__ import annotations

import os
import pickle
import re
import resource
import signal
import sys
import tempfile
import time
import tracemalloc
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from benchmarks.recordings.bag_damage import KINDS, Copy, Form, damaged, forms, write_form
from benchmarks.support.scripts import parser_of, piped
from push_predictor.errors import PushPredictorError
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.recordings.describe import describe_recording

SLACK = 128_000  # bytes: notes, summary, the buffers of files
GROWTH = 16_000_000  # bytes
LONGEST = 2.0  # s of processor time
HANGS = 60  # s of the wall clock


@dataclass(frozen=True)
class Reading:
    """The result of reading a copy. used: correct messages from the first on; strange: never recorded."""

    used: int = 0
    given: int = 0
    strange: int = 0
    notes: tuple[str, ...] = ()
    refused: str = ""
    python: int = 0
    growth: int = 0
    seconds: float = 0.0
    died: str = ""


def main() -> int:
    """Read the copies, print the table."""
    parser = parser_of(__doc__)
    parser.add_argument("--copies", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, nargs="+", help="numbers of the copies to read; their notes are printed")
    options = parser.parse_args()
    __import__("yaml")  # its memory counts once, before the readings
    whole, rows, failures = forms(), defaultdict(list), []
    chosen = options.only or range(options.copies)
    begin = time.perf_counter()
    for number in chosen:
        copy = copy_number(number, options.seed, whole)
        reading = read_apart(copy)
        rows[copy.kind].append((copy, reading))
        if wrong := faults(copy, reading):
            failures.append(f"--seed {options.seed} --only {number}: {copy.form.name}, {copy.kind}: {wrong}")
        if options.only is not None:
            print(copy.kind, copy.must, copy.near, reading)
    print(table(rows, failed_by_kind(rows)))
    print(f"{len(chosen)} copies of {len(whole)} bags in {time.perf_counter() - begin:.0f} s, {len(failures)} failed")
    print(*failures, sep="\n")
    return 1 if failures else 0


def copy_number(number: int, seed: int, whole: list[Form]) -> Copy:
    """Copy number `number`, the same every time; kinds and forms alternate."""
    kinds = list(KINDS)
    form = whole[number // len(kinds) % len(whole)]
    return damaged(form, kinds[number % len(kinds)], Random(f"{seed} {number}"))


def faults(copy: Copy, reading: Reading) -> str:
    """The failures of a reading, in words; empty if there are none."""
    whole = len(copy.form.messages)
    lost = reading.used < whole or reading.given > whole
    found = {
        f"died: {reading.died}": bool(reading.died),
        f"{reading.used} messages of {copy.must} before the damage": reading.used < copy.must,
        f"{reading.strange} messages that were never recorded": copy.form.checked and reading.strange > 0,
        f"not named: {reading.notes} {reading.refused}": lost
        and _can_be_seen(copy, reading)
        and not named(copy, reading),
        f"Python allocated {reading.python} bytes": reading.python > 2 * copy.form.largest + SLACK,
        f"the process grew by {reading.growth} bytes": reading.growth > GROWTH,
        f"took {reading.seconds:.1f} s": reading.seconds > LONGEST,
    }
    return "; ".join(text for text, is_so in found.items() if is_so)


def _can_be_seen(copy: Copy, reading: Reading) -> bool:
    """Whether the damage can be detected; not without checksums or summary, see the module's docstring."""
    if copy.form.name == "no summary" and copy.kind == "a chunk missing":
        return False
    return copy.form.summed or reading.given != len(copy.form.messages)


def named(copy: Copy, reading: Reading) -> bool:
    """Whether a note, or the error if nothing is readable, names the place."""
    if reading.refused:
        return "bag_0.mcap" in reading.refused
    low, high = copy.near
    places = [int(place) for note in reading.notes for place in re.findall(r"at byte (\d+)", note) if "bag_0" in note]
    return any(low <= place <= high for place in places)


def read_apart(copy: Copy) -> Reading:
    """Read a copy in a forked process, which may die or hang."""
    with tempfile.TemporaryDirectory(prefix="fuzz_bags_") as folder:
        path = write_form(Path(folder), copy.form, copy.disk)
        ours, theirs = os.pipe()
        if (child := os.fork()) == 0:
            os.close(ours)
            signal.alarm(HANGS)
            tempfile.tempdir = folder  # removes what the child unpacks there, however the child ends
            with os.fdopen(theirs, "wb") as answer:
                pickle.dump(_read(path, copy), answer)
            os._exit(0)
        os.close(theirs)
        with os.fdopen(ours, "rb") as answer:
            result = answer.read()
        _, status = os.waitpid(child, 0)
    return pickle.loads(result) if result and not status else Reading(died=f"wait status {status}")


def _read(path: Path, copy: Copy) -> Reading:
    """Runs in the forked process."""
    try:
        grown, begin = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
        used, given, strange, notes, refused, held = _messages(path, copy)
        growth = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - grown)
        try:
            described: dict[str, Any] = describe_recording(path)
            notes += tuple(map(str, described["notes"]))
        except (PushPredictorError, OSError):
            pass
        return Reading(used, given, strange, notes, refused, held, growth, time.process_time() - begin)
    except BaseException as error:
        return Reading(died=repr(error))


def _messages(path: Path, copy: Copy) -> tuple[int, int, int, tuple[str, ...], str, int]:
    expected, known = copy.form.messages, frozenset(copy.form.messages)
    used = given = strange = 0
    notes: tuple[str, ...] = ()
    refused = ""
    tracemalloc.start()
    try:
        bag = open_bag(path)
        for message in bag.messages():
            read = (message.topic, message.log_time, message.data)
            used += used == given < len(expected) and read == expected[given]
            strange += read not in known
            given += 1
        notes = tuple(bag.notes)
    except (PushPredictorError, OSError) as error:
        refused = str(error)
    held = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return used, given, strange, notes, refused, held


def failed_by_kind(rows: dict[str, list[tuple[Copy, Reading]]]) -> dict[str, int]:
    """The number of failed copies by kind of damage."""
    return {kind: sum(bool(faults(copy, reading)) for copy, reading in of_kind) for kind, of_kind in rows.items()}


def table(rows: dict[str, list[tuple[Copy, Reading]]], failed: dict[str, int]) -> str:
    """The result in Markdown, a line per kind of damage."""
    lines = [
        "| damage | copies | used / before the damage | used / in the whole bag | lost some | named with offset"
        " | memory, chunks | growth, MB | longest time, s | failed |",
        "| --- " + "| ---: " * 9 + "|",
    ]
    for kind, of_kind in rows.items():
        lost = [(c, r) for c, r in of_kind if r.used < len(c.form.messages)]
        cells = [
            len(of_kind),
            f"{sum(min(r.used, c.must) for c, r in of_kind)} / {sum(c.must for c, r in of_kind)}",
            f"{sum(r.given - r.strange for _, r in of_kind)} / {sum(len(c.form.messages) for c, _ in of_kind)}",
            len(lost),
            sum(named(c, r) for c, r in lost),
            f"{max(r.python / c.form.largest for c, r in of_kind):.2f}",
            f"{max(r.growth for _, r in of_kind) / 1e6:.1f}",
            f"{max(r.seconds for _, r in of_kind):.2f}",
            failed[kind],
        ]
        lines.append(piped([kind, *cells]))
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())

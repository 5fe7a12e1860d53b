# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Command line of the mutations; see the package."""

from __future__ import annotations

import argparse
import json
import os
import queue
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.mutations.mutants import ROOT, Mutant, drawn

MOST_SECONDS = 600  # a mutant may never end: that is noticed


@dataclass
class Judged:
    """A mutant: a test failed (`killed`), none did (`survived`), or its line no longer exists (`gone`)."""

    mutant: Mutant
    result: str
    by: str
    seconds: float


class Map:
    """Which test files call a function, the quickest first; a function that only other processes run has its room's."""

    def __init__(self, folder: Path) -> None:
        self.seconds: Counter[str] = Counter()
        self._files: dict[tuple[str, str], set[str]] = {}
        self._failed: set[str] = set()  # on the sound code: they tell nothing
        for part in folder.glob("*.json"):
            noted = json.loads(part.read_text())
            self.seconds.update(noted["seconds"])
            self._failed.update(noted["failed"])
            for file, names in noted["calls"].items():
                for name in names:
                    self._files.setdefault(tuple(name), set()).add(file)

    def of(self, mutant: Mutant) -> list[str]:
        """The test files to run, in their order."""
        room = "paper" if "paper" in mutant.file else mutant.file.split("/")[-2 if "adapters" in mutant.file else 1]
        files = self._files.get((mutant.file, mutant.function), set())
        if not files:  # code of the module or class itself
            files = {name for (file, _), names in self._files.items() if file == mutant.file for name in names}
        if room in ("nodes", "msg_adapters", "online", "replay") or not files:
            rooms = [ROOT / "test" / name for name in {room, "nodes", "faults"}]
            files = files | {str(path.relative_to(ROOT)) for folder in rooms for path in folder.glob("test_*.py")}
        files = files - self._failed
        own = {file for file in files if f"/{room}/" in file}
        return sorted(own, key=self._cost) + sorted(files - own, key=self._cost)

    def _cost(self, file: str) -> float:
        return self.seconds.get(file, 1.0)


def main() -> int:
    """Draw or read mutants, run the tests of each, write and print what survives."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutations", description=__doc__)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--within", default="", help="only files whose path begins so, as push_predictor/models")
    parser.add_argument("--again", type=Path, help="the mutants of a file written before")
    parser.add_argument("--survivors", action="store_true", help="with --again: only those that survived")
    parser.add_argument(
        "--calls", type=Path, default=Path("out/mutations_calls"), help="folder of the map, made if missing"
    )
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    if not options.calls.is_dir():
        make_map(options.calls.resolve(), options.cores)
    tests = Map(options.calls)
    killers: dict[Mutant, str] = {}
    if options.again:
        killers = read(options.again, options.survivors)
    mutants = list(killers) or drawn(options.count, options.seed, options.within)
    judged = judge(mutants, killers, tests, options.cores, options.out)
    print(table(judged))
    return 0


def read(file: Path, survivors: bool) -> dict[Mutant, str]:
    """The mutants in a file of results, each with the test file that noticed it: it is run first."""
    entries = [json.loads(line) for line in file.read_text().splitlines()]
    chosen = [entry for entry in entries if not survivors or entry["result"] == "survived"]
    return {Mutant(**entry["mutant"]): entry["by"].partition("::")[0] for entry in chosen}


def make_map(folder: Path, cores: int) -> None:
    """Run all tests once with the profiler, on the sound code, in a copy of the tree as mutants are."""
    tree = copied_tree(folder.parent / "mutations_tree")
    plugin = ["-p", "benchmarks.mutations.calls", "--calls", str(folder)]
    call = [sys.executable, "-m", "pytest", "-q", "-n", str(cores), "--dist", "loadfile", "-m", "not long", "--tb=no"]
    subprocess.run([*call, *plugin], cwd=tree, env=environment(tree, 150), check=False)
    shutil.rmtree(tree)


def judge(mutants: list[Mutant], killers: Mapping[Mutant, str], tests: Map, cores: int, out: Path) -> list[Judged]:
    """Judge all mutants on `cores` copies of the tree; each result is appended to the file at once."""
    waiting: queue.SimpleQueue[Mutant] = queue.SimpleQueue()
    for mutant in mutants:
        waiting.put(mutant)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text("")
    judged: list[Judged] = []

    def work(number: int) -> None:
        tree = copied_tree(out.parent / f"mutations_tree_{number}")
        while not waiting.empty():
            mutant = waiting.get()
            files = tests.of(mutant)
            result = judge_one(mutant, [[killers.get(mutant, "")], files], tree, 150 + number)
            judged.append(result)
            with out.open("a") as file:
                file.write(json.dumps(asdict(result)) + "\n")
            done = f"{len(judged)}/{len(mutants)} {result.result:8} {result.seconds:5.0f} s"
            print(done, result.mutant.file, result.mutant.after.strip(), flush=True)
        shutil.rmtree(tree)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(cores)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return judged


def copied_tree(tree: Path) -> Path:
    """A copy of the tracked and new files, with the compiled modules."""
    shutil.rmtree(tree, ignore_errors=True)
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    compiled = [str(path.relative_to(ROOT)) for path in (ROOT / "push_predictor").rglob("*.so")]
    for name in [*listed.stdout.splitlines(), *compiled]:
        if (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tree / name)
    return tree


def judge_one(mutant: Mutant, tests: Sequence[Sequence[str]], tree: Path, domain: int) -> Judged:
    """Put one mutant into the copy, run groups of test files until a test fails, and take it out again."""
    path = tree / mutant.file
    sound = path.read_text() if path.is_file() else ""
    changed = mutant.applied(sound)
    if changed is None:
        return Judged(mutant, "gone", "", 0.0)
    begin = time.monotonic()
    path.write_text(changed)
    try:
        by = next((by for files in tests if (by := failed_test(files, tree, domain))), "")
    finally:
        path.write_text(sound)
    return Judged(mutant, "killed" if by else "survived", by, time.monotonic() - begin)


def failed_test(files: Sequence[str], tree: Path, domain: int) -> str:
    """The first test that fails, empty if none does."""
    present = [file for file in files if (tree / file).is_file()]
    if not present:
        return ""
    call = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-m", "not long", "--tb=no", *present]
    with subprocess.Popen(
        call,
        cwd=tree,
        env=environment(tree, domain),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as run:
        try:
            text, _ = run.communicate(timeout=MOST_SECONDS)
        except subprocess.TimeoutExpired:
            os.killpg(run.pid, signal.SIGKILL)
            return "did not end"
    if run.returncode in (0, 5):
        return ""
    found = re.search(r"^(?:FAILED|ERROR) (\S+)", text, re.MULTILINE)
    return found[1] if found else text.strip()[-200:]


def environment(tree: Path, domain: int) -> dict[str, str]:
    """The environment of tests in a copy of the tree, whose nodes hear no other copy's."""
    own = {"PYTHONPATH": str(tree), "ROS_DOMAIN_ID": str(domain), "PYTHONDONTWRITEBYTECODE": "1"}
    return {**os.environ, **own, "OPENBLAS_NUM_THREADS": "1"}


def table(judged: list[Judged]) -> str:
    """How many of each kind were noticed, and the survivors."""
    results = Counter(one.result for one in judged)
    kinds = Counter((one.mutant.kind, one.result) for one in judged)
    lines = [
        f"{len(judged)} mutants: {results['killed']} killed, {results['survived']} survived, {results['gone']} gone",
        "",
    ]
    lines += [
        f"{kind}: {kinds[kind, 'killed']} of {kinds[kind, 'killed'] + kinds[kind, 'survived']}"
        for kind in sorted({kind for kind, _ in kinds})
    ]
    survivors = sorted(
        (one.mutant.file, one.mutant.function, one.mutant.before.strip(), one.mutant.after.strip())
        for one in judged
        if one.result == "survived"
    )
    lines += [""] + [f"{file} {function}\n    {before}\n    {after}" for file, function, before, after in survivors]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Work on many cores: results in order, kept on disk, resumed after an interruption."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from joblib.externals.loky import get_reusable_executor
from push_predictor_paper.work import Work, fingerprint

import push_predictor
from push_predictor_paper import work as work_module

SOURCES = [Path(module.__file__).parents[1] for module in (push_predictor, work_module)]  # what workers import from
PIECES = textwrap.dedent(
    """
    import os
    import time
    from pathlib import Path

    def squared(number, log):
        with Path(log).open("a") as lines:
            lines.write(f"{number}\\n")
        return number * number

    def slowly(number, log):
        while number > 3 and not Path(log).with_name("go_on").exists():
            time.sleep(0.05)
        return squared(number, log)
    """
)


@pytest.fixture
def pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[object]:
    """A module of small pieces of work, importable here and in every process started from here."""
    (tmp_path / "pieces_of_work.py").write_text(PIECES)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *map(str, SOURCES)]))
    get_reusable_executor().shutdown(wait=True)  # processes that other tests have left know nothing of the module
    import pieces_of_work

    yield pieces_of_work
    del sys.modules["pieces_of_work"]


def lines(log: Path) -> list[int]:
    return sorted(int(line) for line in log.read_text().split()) if log.exists() else []


@pytest.mark.parametrize("cores", [1, 2])
def test_results_come_in_the_order_of_the_calls(pieces, tmp_path: Path, cores: int) -> None:
    work = Work(tmp_path / "kept", cores=cores)
    assert work.run("squares", pieces.squared, [(n, str(tmp_path / "log")) for n in (3, 1, 2)]) == [9, 1, 4]


def test_a_repeated_call_is_read_from_disk(pieces, tmp_path: Path) -> None:
    log = tmp_path / "log"
    Work(tmp_path / "kept", cores=1).run("squares", pieces.squared, [(2, str(log)), (3, str(log))])
    again = Work(tmp_path / "kept", cores=1).run("squares", pieces.squared, [(3, str(log)), (4, str(log))])
    assert again == [9, 16]
    assert lines(log) == [2, 3, 4]


def test_the_watch_sees_the_start_and_every_job_cached_ones_too(pieces, tmp_path: Path) -> None:
    for _ in range(2):
        seen: list[tuple[str, float]] = []
        calls = [(n, str(tmp_path / "log")) for n in range(4)]
        work = Work(tmp_path / "kept", cores=1)
        work.watch = lambda doing, done, seen=seen: seen.append((doing, done))
        work.run("squares", pieces.squared, calls)
        assert seen == [(f"squares {k} of 4", k / 4) for k in range(5)]


@pytest.mark.slow
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_results_before_an_interruption_are_kept(pieces, tmp_path: Path, end: signal.Signals) -> None:
    log, count, cores = tmp_path / "log", 8, 2
    process = started(tmp_path, log, cores, count)
    try:
        wait_for(lambda: len(lines(log)) >= 3)
        os.killpg(process.pid, end)  # as a terminal does
        assert process.wait(timeout=60) != 0
    finally:
        end_group(process)
    done = len(lines(log))
    assert 3 <= done < count
    (tmp_path / "go_on").touch()
    results = Work(tmp_path / "kept", cores=1).run("slow squares", pieces.slowly, calls_of(log, count))
    assert results == [n * n for n in range(count)]
    assert len(lines(log)) <= count + cores  # at most what was being written when it ended is made again


def test_an_interruption_that_storing_swallows_ends_the_work_all_the_same(pieces, tmp_path: Path, monkeypatch) -> None:
    def interrupted_while_storing(*_: object) -> None:
        with contextlib.suppress(BaseException):  # as joblib does
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("joblib._store_backends.StoreBackendMixin.store_metadata", interrupted_while_storing)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background ignores it
    try:
        with pytest.raises(KeyboardInterrupt):
            Work(tmp_path / "kept", cores=1).run("squares", pieces.squared, calls_of(tmp_path / "log", 3))
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert lines(tmp_path / "log") == [0]


def started(folder: Path, log: Path, cores: int, count: int) -> subprocess.Popen[bytes]:
    """Another process at the same work, leader of its own group."""
    program = textwrap.dedent(
        f"""
        import signal
        from pathlib import Path
        from pieces_of_work import slowly
        from push_predictor_paper.work import Work
        signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background ignores it
        Work(Path({str(folder / "kept")!r}), cores={cores}).run("slow squares", slowly, {calls_of(log, count)!r})
        """
    )
    return subprocess.Popen([sys.executable, "-c", program], start_new_session=True, stderr=subprocess.DEVNULL)


def calls_of(log: Path, count: int) -> list[tuple[int, str]]:
    return [(n, str(log)) for n in range(count)]


def end_group(process: subprocess.Popen[bytes]) -> None:
    """Whatever a killed leader has left of its workers."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait(timeout=60)


def wait_for(condition, timeout: float = 120.0) -> None:
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


@pytest.fixture
def copied_packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with copies of both packages; the fingerprint is made from them."""
    packages = {push_predictor: tmp_path / "push_predictor", work_module: tmp_path / "push_predictor_paper"}
    for module, copy in packages.items():
        shutil.copytree(Path(module.__file__).parent, copy, ignore=shutil.ignore_patterns("__pycache__"))
        monkeypatch.setattr(module, "__file__", str(copy / Path(module.__file__).name))
    return tmp_path


def fresh_fingerprint() -> str:
    return fingerprint.__wrapped__()


MATTER = (
    "push_predictor/models/gaussian_process/gp.py",
    "push_predictor/simulation/dynamics.py",
    "push_predictor/recordings/windows/finder.py",
    "push_predictor_paper/fits/fit.py",
    "push_predictor_paper/data/corpus.py",
)
LAYOUT = (
    "push_predictor/reporting/html.py",
    "push_predictor/evaluation/report/figures/gallery.py",
    "push_predictor/evaluation/report/page.py",
    "push_predictor_paper/sections/data.py",
    "push_predictor_paper/painters/__init__.py",
    "push_predictor_paper/report.py",
    "push_predictor_paper/claims.py",
)


def test_a_change_of_a_source_changes_the_fingerprint_if_it_matters_and_not_if_it_is_layout(
    copied_packages: Path,
) -> None:
    """One file after the other, in one copy."""
    before = fresh_fingerprint()
    for name in (*MATTER, *LAYOUT):
        path, text = copied_packages / name, (copied_packages / name).read_text()
        path.write_text(text + "\nANOTHER = 1\n")
        assert (fresh_fingerprint() != before) == (name in MATTER), name
        path.write_text(text)
        assert fresh_fingerprint() == before


def test_a_new_and_a_renamed_source_change_the_fingerprint(copied_packages: Path) -> None:
    before = fresh_fingerprint()
    another = copied_packages / "push_predictor" / "models" / "another.py"
    another.write_text("")
    added = fresh_fingerprint()
    another.rename(another.with_name("renamed.py"))
    assert len({before, added, fresh_fingerprint()}) == 3


def test_results_are_kept_under_the_fingerprint(tmp_path: Path) -> None:
    assert Work(tmp_path, cores=1).folder == tmp_path / fingerprint()

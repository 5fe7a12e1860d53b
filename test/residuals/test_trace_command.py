# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor trace: its output, its options and its errors."""

from __future__ import annotations

import contextlib
import io
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from made_up_traces import made_up_trace, pushes, slippery
from search_bench import in_library
from synthetic import square_rig

import push_predictor.residuals.trace as trace_module
from push_predictor.cli import main
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.train import train_model
from push_predictor.recordings.table_file import write_table
from push_predictor.reporting import html
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting import page

SECTION_5 = {
    "verdict", "effect_present", "channel", "kind", "covariates", "equivalent", "undecided", "motion_model_changed",
    "effects", "before", "refit", "after", "gain", "minimum_detectable", "remaining", "experiment", "tested", "pushes",
}  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def a_library_of_two() -> Iterator[None]:
    """The search takes most of the time, and the command does not depend on its mechanisms."""
    with pytest.MonkeyPatch.context() as patch:
        in_library(patch, "contact_friction", "pressure_spread")
        yield


@pytest.fixture(scope="module")
def extended() -> Trace:
    return made_up_trace(slippery(0.06), count=90)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model and a table of pushes whose contact friction drifts."""
    folder = tmp_path_factory.mktemp("trace")
    save_model(train_model(pushes(60, 1), square_rig(), "analytical", name="deployed"), folder / "deployed.pushmodel")
    write_table(folder / "new.csv", pushes(60, 2, slippery(0.1)))
    (folder / "new.rig.yaml").write_text(json.dumps(square_rig().to_record()))
    return folder


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Replaces the trace of the command by a given one and records its arguments."""
    asked: dict[str, Any] = {}

    def find(trace: Trace) -> dict[str, Any]:
        def trace_data(paths: Sequence[Path], model: Path, **options: Any) -> Trace:
            asked.update(paths=paths, model=model, **options)
            return trace

        monkeypatch.setattr(trace_module, "trace_data", trace_data)
        return asked

    return find


def run(place: Path, *options: str) -> int:
    return main(["trace", str(place / "deployed.pushmodel"), str(place / "new.csv"), *options])


@dataclass(frozen=True)
class Traced:
    """The files that the command left of one trace, what it printed, and the trace itself."""

    out: Path
    model: Path
    printed: str
    trace: Trace


@pytest.fixture(scope="module")
def traced(place: Path, tmp_path_factory: pytest.TempPathFactory) -> Traced:
    folder, traces = tmp_path_factory.mktemp("traced") / "sub", []
    out, model = folder / "out.json", folder / "extended.pushmodel"
    real = trace_module.trace_data
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(io.StringIO()) as printed:
        patch.setattr(
            trace_module, "trace_data", lambda *given, **options: traces.append(real(*given, **options)) or traces[0]
        )
        saved = ["--json", str(out), "--save-model", str(model)]
        assert run(place, "--covariates", "elapsed_time,slider_x", *saved) == 0
    return Traced(out, model, printed.getvalue(), traces[0])


@pytest.mark.slow
def test_trace_of_a_table_writes_json_and_extended_model(traced: Traced) -> None:
    result = json.loads(traced.out.read_text())
    assert set(result) >= SECTION_5 and result["pushes"] == {"analysis": 42, "held_out": 18}
    assert result["effects"][0]["covariate"] == "elapsed_time" and result["motion_model_changed"]
    model = load_model(traced.model)
    assert model.needs == () and list(model.defaults) == ["elapsed_time"]
    assert "requests need no further covariates; defaults: elapsed_time 1000" in traced.printed


def test_options_reach_the_trace(place: Path, found: Any, extended: Trace, capsys: pytest.CaptureFixture[str]) -> None:
    asked = found(extended)
    assert run(place, "--covariates", "topic:/warmth, elapsed_time", "--alpha", "0.05", "--seed", "7") == 0
    assert asked["covariates"] == ["topic:/warmth", "elapsed_time"]
    assert (asked["alpha"], asked["seed"], asked["rig"]) == (0.05, 7, None)
    assert run(place, "--rig", str(place / "new.rig.yaml")) == 0
    assert asked["covariates"] is None and asked["alpha"] == 0.01 and asked["rig"].shape == "rect1"


def test_json_on_stdout_is_the_only_output(
    place: Path, tmp_path: Path, found: Any, extended: Trace, capsys: pytest.CaptureFixture[str]
) -> None:
    found(replace(extended, extended=None))
    assert run(place, "--json", "-", "--save-model", str(tmp_path / "extended.pushmodel")) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["verdict"] == "effect"
    assert "is not written: the motion model did not change" in printed.err
    assert list(tmp_path.iterdir()) == []


def test_prints_verdict_worth_and_held_out_figures_without_json(
    place: Path, found: Any, extended: Trace, capsys: pytest.CaptureFixture[str]
) -> None:
    found(extended)
    assert run(place) == 0
    text = capsys.readouterr().out
    assert text.startswith("Contact friction changes with elapsed time.\n")
    assert "\nContact friction changes with elapsed time. It shifts a window by 0." in text
    assert "\nUse the extended model: on " in text and extended.held_out.digest in text
    for name in ("before", "refit", "after"):
        assert f"\n{name} " in text


def test_a_covariate_that_is_not_there_is_named_with_those_that_are(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(place, "--covariates", "topic:/absent") == 1
    line = capsys.readouterr().err.splitlines()[-1]
    assert all(word in line for word in ("push_predictor trace: ", "topic:/absent", "elapsed_time", "slider_x")), line


def unwritable(patch: pytest.MonkeyPatch) -> None:
    patch.setattr("os.access", lambda *_: False)  # root may write anywhere


def without_jinja2(patch: pytest.MonkeyPatch) -> None:
    html._environment.cache_clear()
    patch.setitem(sys.modules, "jinja2", None)


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        (unwritable, ["a path in a folder with write permission: "]),
        (without_jinja2, ["--report: pages need Jinja2", "pip install 'push_predictor[report]'"]),
    ],
)
def test_a_report_that_cannot_be_written_is_refused_before_the_work(
    place: Path, tmp_path: Path, found: Any, extended: Trace, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch, broken: Callable[[pytest.MonkeyPatch], None], words: list[str],
) -> None:  # fmt: skip
    asked = found(extended)
    broken(monkeypatch)
    assert run(place, "--report", str(tmp_path / "new" / "out.html")) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("push_predictor trace: --report") and all(word in line for word in words) and asked == {}
    assert run(place) == 0  # without --report neither is needed


def test_report_needs_no_matplotlib(
    place: Path, tmp_path: Path, found: Any, extended: Trace, monkeypatch: pytest.MonkeyPatch
) -> None:
    found(extended)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert run(place, "--report", str(tmp_path / "out.html")) == 0
    assert (tmp_path / "out.html").read_text().count('<svg class="chart') >= 3  # key picture, errors


def test_files_and_verdict_come_before_the_report(
    place: Path, tmp_path: Path, found: Any, extended: Trace, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    found(extended)
    out, model = tmp_path / "new" / "out.json", tmp_path / "new" / "extended.pushmodel"
    seen: dict[str, Any] = {}

    def fail(trace: Trace) -> list[str]:
        seen.update(out=out.exists(), model=model.exists(), printed=capsys.readouterr().out)
        raise ZeroDivisionError("a picture\nfailed")

    monkeypatch.setattr(page, "_parts", fail)
    report = tmp_path / "new" / "out.html"
    assert run(place, "--json", str(out), "--save-model", str(model), "--report", str(report)) == 1
    assert seen["out"] and seen["model"]
    assert seen["printed"].startswith("Contact friction changes with") and f"extended model: {model}" in seen["printed"]
    error = capsys.readouterr().err
    assert error.startswith(f"push_predictor trace: {report}: the report could not be drawn (ZeroDivisionError: a ")
    assert error.count("\n") == 1 and not report.exists()


def test_prints_the_verdict_when_the_model_cannot_be_written(
    place: Path, tmp_path: Path, found: Any, extended: Trace, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    found(extended)

    def fail(*_: Any) -> None:
        raise OSError(28, "No space left on device", "extended.pushmodel")

    monkeypatch.setattr("push_predictor.models.store.model_file.save_model", fail)
    assert run(place, "--save-model", str(tmp_path / "extended.pushmodel")) == 1
    printed = capsys.readouterr()
    assert printed.out.startswith("Contact friction changes with") and "extended model: extended" not in printed.out
    assert printed.err == "push_predictor trace: extended.pushmodel: No space left on device\n"

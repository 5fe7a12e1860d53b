"""`push_predictor report paper --quick`: every claim of the paper, with one command; resumed when asked again."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from push_predictor_paper.plan import FULL, QUICK, Plan
from push_predictor_paper.report import report_paper
from push_predictor_paper.work import Work

from push_predictor.cli import main

CLAIMS = {
    "data", "kinds_of_push", "maps", "noise", "learning_curves", "comparison", "mean_gain", "speed_error", "divergence",
    "modality", "quasi_static", "calibration", "variants",
}  # fmt: skip
VERDICTS = {"holds", "holds in part", "does not hold", "not decided"}


SMALL = replace(
    QUICK, speeds=(0.02, 0.05, 0.1), pushes=50, reference_pushes=70, sizes=(20, 100), contacts=3, angle_step=0.75,
    repetitions=12, other_repetitions=12, speed_pushes=6, informed=False,
)  # fmt: skip


class Stages:
    """The titles of the stages, in order."""

    def __init__(self) -> None:
        self.titles: list[str] = []

    def stage(self, number: int, of: int, title: str) -> None:
        self.titles.append(title)


def report(out: Path, cache: Path) -> Stages:
    stages = Stages()
    # One process: test_paper_work shows that several do the same work, and each would first import the packages.
    report_paper(SMALL, Work(cache, cores=1), out, None, None, stages)
    return stages


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("paper")
    with pytest.MonkeyPatch.context() as coarse:
        coarse.setattr("push_predictor.reporting.canvas.LAYOUTS", 1)  # every label is fitted once
        assert report(out, out / "work").titles[0] == "recordings"
    return out


@pytest.mark.slow
def test_each_claim_has_verdict_and_numbers(made: Path) -> None:
    content = json.loads((made / "paper.json").read_text())
    assert set(content["sections"]) == CLAIMS
    for key, section in content["sections"].items():
        assert section["findings"], key
        for finding in section["findings"]:
            assert finding["verdict"] in VERDICTS, finding
            assert re.search(r"\d", finding["sentence"]), finding


@pytest.mark.slow
def test_page_is_self_contained_and_warns_that_it_is_quick(made: Path) -> None:
    page = (made / "paper.html").read_text()
    for key in CLAIMS:
        assert f'<h2 id="{key}">' in page
    sources = re.findall(r'(?:src|href)="([^"]{0,30})', page)
    assert all(source.startswith(("data:image/png;base64,", "#")) for source in sources)
    assert page.count("<img") >= len(CLAIMS)
    assert "Made with --quick" in page


@pytest.mark.slow
def test_questions_beyond_the_paper_have_their_own_table(made: Path) -> None:
    page = (made / "paper.html").read_text()
    paper, ours = re.findall(r'<table class="verdicts">.*?</table>', page, re.DOTALL)
    assert "claim of the paper" in paper and "question beyond the paper" in ours
    for section in ("calibration", "variants"):
        assert f'href="#{section}"' in ours and f'href="#{section}"' not in paper
    findings = [f for s in json.loads((made / "paper.json").read_text())["sections"].values() for f in s["findings"]]
    assert paper.count("<tr><td>") == sum(finding["origin"] == "paper" for finding in findings) > 0
    assert ours.count("<tr><td>") == sum(finding["origin"] == "beyond the paper" for finding in findings) > 0


@pytest.mark.slow
def test_page_contains_no_nan(made: Path) -> None:
    page = (made / "paper.html").read_text()
    assert "nan" not in re.sub(r"base64,[^\"]+", "", page).lower().split()


@pytest.mark.slow
def test_simulated_and_measured_pushes_share_no_table(made: Path) -> None:
    content = json.loads((made / "paper.json").read_text())
    for section in content["sections"].values():
        for table in section["tables"]:
            assert not ("simulated:" in table["caption"] and "measured:" in table["caption"])


@pytest.mark.slow
def test_second_report_reads_the_cache_and_is_the_same(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pictures are not rendered again: the cache does not contain them."""
    monkeypatch.setattr("push_predictor.reporting.canvas.LAYOUTS", 0)
    monkeypatch.setattr(
        "matplotlib.backends.backend_agg.FigureCanvasAgg.print_png", lambda canvas, image: image.write(b"")
    )
    kept = kept_results(made)
    assert kept
    report(tmp_path, made / "work")
    assert kept_results(made) == kept
    first, second = (json.loads((out / "paper.json").read_text())["sections"] for out in (made, tmp_path))
    assert second == first


def kept_results(out: Path) -> dict[Path, int]:
    """Every result on disk with the time at which it was written."""
    return {path: path.stat().st_mtime_ns for path in (out / "work").rglob("output.pkl")}


@pytest.mark.parametrize(
    "options, named",
    [
        (["--jobs", "0"], "--jobs"),
        (["--data", "no/such/folder"], "--data"),
        (["--model", "x.pushmodel"], "--model"),
    ],
)
def test_names_a_wrong_option(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], named: str
) -> None:
    assert main(["report", "paper", "--quick", "--out", str(tmp_path), *options]) == 1
    assert named in capsys.readouterr().err


@pytest.mark.parametrize(("options", "plan"), [(["--quick"], QUICK), ([], FULL)])
def test_the_command_computes_the_plan_that_was_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], options: list[str], plan: Plan
) -> None:
    asked: list[object] = []

    def computed(*arguments: object) -> tuple[Path, dict[str, object]]:
        asked.extend(arguments)
        return tmp_path / "paper.html", {}

    monkeypatch.setattr("push_predictor_paper.report.report_paper", computed)
    assert main(["report", "paper", "--out", str(tmp_path), *options]) == 0
    assert asked[0] == plan and asked[2] == tmp_path and capsys.readouterr().out.strip().endswith("paper.html")

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""`push_predictor report paper --quick`: every claim of the paper, with one command; resumed when asked again.

The pushes are drawn from a formula: test_paper_data shows what the simulated ones are.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from html import unescape
from pathlib import Path

import paper_studies
import pytest
from markupsafe import escape
from push_predictor_paper.claims import CLAIMS
from push_predictor_paper.plan import FULL, QUICK, Plan
from push_predictor_paper.report import report_paper
from push_predictor_paper.study import gather
from push_predictor_paper.work import Work

from push_predictor.cli import main
from push_predictor.reporting.html import NOTHING

VERDICTS = {"holds", "holds in part", "does not hold", "not decided"}


SMALL = replace(
    QUICK, speeds=(0.02, 0.05, 0.1), pushes=30, reference_pushes=72, sizes=(20, 60), contacts=3, angle_step=0.75,
    repetitions=12, other_repetitions=11, speed_pushes=4,
)  # fmt: skip

CELL = re.compile(r'<th scope="row">(.*?)</th>|<td[^>]*>(.*?)(?:<span class="interval">(.*?)</span>)?</td>')


def report(out: Path, cache: Path) -> list[tuple[str, float]]:
    """Make the report; returns the stages with the share of the work before each."""
    stages: list[tuple[str, float]] = []
    # One process: test_paper_work shows that several do the same work, and each would first import the packages.
    report_paper(SMALL, Work(cache, cores=1), out, None, None, lambda *stage: stages.append(stage))
    return stages


@pytest.fixture(scope="module", autouse=True)
def small() -> Iterator[None]:
    """Recordings from a formula."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("push_predictor_paper.data.corpus.learning_set", paper_studies.learning_set)
        patch.setattr("push_predictor_paper.data.repetitions.repeat_push", paper_studies.repeat_push)
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("paper")
    stages = report(out, out / "work")
    (first, begin), (second, same) = stages[:2]
    assert first.endswith(" recordings") and second.startswith(f"{first}: ") and begin == same == 0.0
    begins = [share for stage, share in stages if ": " not in stage]
    assert len(begins) > 5 and begins == sorted({*begins}) and begins[-1] < 1.0
    return out


def test_study_has_the_sets_and_repetitions_of_the_plan(tmp_path: Path) -> None:
    study = gather(SMALL, Work(tmp_path / "work", cores=1), tmp_path, None, None)
    assert {pair: len(found.table.pushes) for pair, found in study.simulated.sets.items()} == {
        ("rect1", "plywood"): 72, ("rect1", "abs"): 30, ("ellip1", "plywood"): 30, ("ellip1", "abs"): 30,
    }  # fmt: skip
    assert study.simulated.reference == ("rect1", "plywood") and study.measured == ()
    commanded = {surface: [cell.commanded for cell in grid.cells] for surface, grid in study.grids.items()}
    assert commanded == {"plywood": [12] * 15, "abs": [11] * 15}


@pytest.mark.long
def test_each_claim_has_verdict_and_numbers_here_and_in_the_summary(made: Path) -> None:
    page, content = (made / "paper.html").read_text(), json.loads((made / "paper.json").read_text())
    assert set(content["sections"]) == set(CLAIMS)
    for key, section in content["sections"].items():
        assert len(section["findings"]) == len(CLAIMS[key])
        for finding in section["findings"]:
            assert finding["verdict"] in VERDICTS, finding
            assert re.search(r"\d", finding["sentence"]), finding
            nothing_to_measure = finding["verdict"] == "not decided" and finding["number"] == NOTHING
            assert nothing_to_measure or re.search(r"\d", finding["number"]), finding
            assert f"<td>{escape(finding['number'])}</td>" in page, finding


@pytest.mark.long
def test_page_is_self_contained_and_warns_that_it_is_quick(made: Path) -> None:
    page = (made / "paper.html").read_text()
    for key in CLAIMS:
        assert f'<h2 id="{key}">' in page
    assert all(source.startswith("data:image/png;base64,") for source in re.findall(r'src="([^"]{0,30})', page))
    assert all(target.startswith(("#", "tables/")) for target in re.findall(r'href="([^"]{0,30})', page))
    assert page.count("<img") >= len(CLAIMS) - 1
    opening = page[page.index('<section class="opening">') : page.index("</section>")]
    assert page.index('class="opening"') < page.index("<h2") and opening.count("<figure") == 1
    assert re.search(r"<p>Of \d+ claims of the paper, ", opening) and opening.count('<div class="bar"') == 1
    assert "Made with <code>--quick</code>" in page
    assert '<h2 id="modality">Single pushes: histograms and modes (paper: figure 10)</h2>' in page
    assert "nan" not in re.sub(r"base64,[^\"]+", "", page).lower().split()


@pytest.mark.long
def test_files_of_tables_equal_the_tables_of_the_page(made: Path) -> None:
    page, content = (made / "paper.html").read_text(), json.loads((made / "paper.json").read_text())
    tables = [(f"{key}_{n}", t) for key, s in content["sections"].items() for n, t in enumerate(s["tables"], 1)]
    shown = page.split('<details class="tabular">')[1:]
    assert len(shown) == len(tables) == len(list((made / "tables").glob("*.csv"))) > len(CLAIMS)
    for part, (name, table) in zip(shown, tables, strict=True):
        assert f'<a href="tables/{name}.csv">CSV</a>' in part
        cells = CELL.findall(part)
        seen = [unescape(text).replace("−", "-") for found in cells for text in found if text]
        with (made / "tables" / f"{name}.csv").open(newline="") as file:
            _, *rows = csv.reader(file)
        assert [cell for row in rows for cell in row if cell] == seen and len(rows) == len(table["rows"])


@pytest.mark.long
def test_simulated_and_measured_pushes_share_no_table(made: Path) -> None:
    content = json.loads((made / "paper.json").read_text())
    for section in content["sections"].values():
        for table in section["tables"]:
            assert not ("simulated:" in table["caption"] and "measured:" in table["caption"])


@pytest.mark.long
def test_second_report_reads_the_cache_and_is_the_same(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pictures are not rendered again: the cache does not contain them."""
    monkeypatch.setattr(
        "matplotlib.backends.backend_agg.FigureCanvasAgg.print_png", lambda canvas, image, **_: image.write(b"")
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


@pytest.mark.parametrize("options, named", [(["--jobs", "0"], "--jobs"), (["--data", "no/such/folder"], "--data")])
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
        return tmp_path / "paper.html", {"verdicts": {"holds": 3, "not decided": 1}}

    monkeypatch.setattr("push_predictor_paper.report.report_paper", computed)
    assert main(["report", "paper", "--out", str(tmp_path), *options]) == 0
    assert asked[0] == plan and asked[2] == tmp_path
    assert capsys.readouterr().out == f"{tmp_path / 'paper.html'}\nclaims: holds 3, not decided 1\n"

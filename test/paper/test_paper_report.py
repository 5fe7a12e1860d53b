"""`push_predictor report paper --quick`: every claim of the paper, with one command; resumed when asked again."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from repository import REPOSITORY

CLAIMS = {
    "data", "kinds_of_push", "maps", "noise", "learning_curves", "comparison", "mean_gain", "speed_error", "divergence",
    "modality", "quasi_static", "calibration", "variants",
}  # fmt: skip
VERDICTS = {"holds", "holds in part", "does not hold", "not decided"}


def report(out: Path, *more: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "push_predictor.cli", "report", "paper", "--quick", "--out", str(out), *more]
    return subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=900)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("paper")
    done = report(out)
    assert done.returncode == 0, done.stderr
    assert "recordings" in done.stderr  # where it is, for who waits
    return out


def test_each_claim_has_figure_number_interval_and_verdict(made: Path) -> None:
    content = json.loads((made / "paper.json").read_text())
    assert set(content["sections"]) == CLAIMS
    for key, section in content["sections"].items():
        assert section["findings"], key
        for finding in section["findings"]:
            assert finding["verdict"] in VERDICTS, finding
            assert re.search(r"\d", finding["sentence"]), finding


def test_the_page_stands_alone_and_warns_that_it_is_quick(made: Path) -> None:
    page = (made / "paper.html").read_text()
    for key in CLAIMS:
        assert f'<h2 id="{key}">' in page
    sources = re.findall(r'(?:src|href)="([^"]{0,30})', page)
    assert all(source.startswith(("data:image/png;base64,", "#")) for source in sources)
    assert page.count("<img") >= len(CLAIMS)
    assert "Made with --quick" in page


def test_what_the_paper_does_not_claim_is_listed_apart(made: Path) -> None:
    page = (made / "paper.html").read_text()
    paper, ours = re.findall(r'<table class="verdicts">.*?</table>', page, re.DOTALL)
    assert "claim of the paper" in paper and "question beyond the paper" in ours
    for section in ("calibration", "variants"):
        assert f'href="#{section}"' in ours and f'href="#{section}"' not in paper
    findings = [f for s in json.loads((made / "paper.json").read_text())["sections"].values() for f in s["findings"]]
    assert paper.count("<tr><td>") == sum(finding["origin"] == "paper" for finding in findings) > 0
    assert ours.count("<tr><td>") == sum(finding["origin"] == "beyond the paper" for finding in findings) > 0


def test_no_word_of_the_page_is_not_a_number(made: Path) -> None:
    page = (made / "paper.html").read_text()
    assert "nan" not in re.sub(r"base64,[^\"]+", "", page).lower().split()


def test_simulated_and_measured_pushes_share_no_table(made: Path) -> None:
    content = json.loads((made / "paper.json").read_text())
    for section in content["sections"].values():
        for table in section["tables"]:
            assert not ("simulated:" in table["caption"] and "measured:" in table["caption"])


def test_made_again_it_reads_what_it_kept_and_says_the_same(made: Path) -> None:
    before, kept = json.loads((made / "paper.json").read_text())["sections"], kept_results(made)
    assert kept and report(made).returncode == 0
    assert kept_results(made) == kept
    assert json.loads((made / "paper.json").read_text())["sections"] == before


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
def test_a_wrong_option_is_named(tmp_path: Path, options: list[str], named: str) -> None:
    done = report(tmp_path, *options)
    assert done.returncode == 1 and named in done.stderr and "Traceback" not in done.stderr

# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The report: every claim of the paper with picture, numbers and verdict, as HTML and as JSON."""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from push_predictor import __version__
from push_predictor.recordings.atomic import write_whole
from push_predictor.reporting import html
from push_predictor.watch import Watch, no_watch
from push_predictor_paper.claims import data
from push_predictor_paper.claims.calibration import section as calibration
from push_predictor_paper.claims.comparison import mean_gain, speed_error
from push_predictor_paper.claims.comparison import section as comparison
from push_predictor_paper.claims.divergence import section as divergence
from push_predictor_paper.claims.learning import learning_curves
from push_predictor_paper.claims.maps import section as maps
from push_predictor_paper.claims.noise import section as noise
from push_predictor_paper.claims.quasi_static import section as quasi_static
from push_predictor_paper.claims.repeated_pushes import kinds_of_push, modality
from push_predictor_paper.data.corpus import simulated_corpus
from push_predictor_paper.data.measured import measured_corpora
from push_predictor_paper.data.repetitions import repeated_grid
from push_predictor_paper.plan import Plan
from push_predictor_paper.presentation.enough import too_little
from push_predictor_paper.presentation.places import PLACES, heading
from push_predictor_paper.presentation.summary import CLAIMS as CLAIM_KINDS
from push_predictor_paper.presentation.summary import counts, opening_sentences
from push_predictor_paper.presentation.table_files import write_tables
from push_predictor_paper.section import Origin, Section
from push_predictor_paper.study import Study
from push_predictor_paper.work import Work, fingerprint

PAPER = "Bauza and Rodriguez, A Probabilistic Data-Driven Model for Planar Pushing, ICRA 2017"
CLAIMS: Mapping[str, Callable[[Study], Section]] = {  # by what the progress bar shows
    "data": data.section,
    "kinds of push": kinds_of_push.section,
    "maps": maps.section,
    "noise": noise.section,
    "learning curves": learning_curves.section,
    "comparison": comparison.section,
    "mean gain": mean_gain.section,
    "speed error": speed_error.section,
    "divergence": divergence.section,
    "modality": modality.section,
    "quasi-static": quasi_static.section,
    "calibration": calibration.section,
}
HOW_TO_READ = (
    "Each verdict follows from the numbers by a rule that its finding states. Intervals are 95 %.",
    "Windows of one push are not independent. Intervals therefore resample whole pushes, or span seeds and folds, "
    "as each caption states. The split that counts holds out whole pushes. The paper used a random split of "
    "windows; it is shown for comparison.",
    "NMSE and NLPD are sums over dx, dy and dtheta. NLPD is in SI units (m, m, rad). In mm and rad it is 13.8155 "
    "higher.",
    "Simulated and measured pushes never share a table. A claim that holds in the simulator shows that the method "
    "works and that the simulated physics suffices for the effect. It does not show that real pushes behave so.",
)
QUICK_WARNING = (
    "Made with `--quick`: a few small recordings, to check that everything runs. Intervals are wide. Verdicts in grey "
    "have too little data; their sections state what they lack. Without `--quick` the paper's full size is computed."
)
COUNTS = "Number of verdicts. Each claim and its number are in the tables below."
Files = Mapping[str, Sequence[Mapping[str, str]]]


def report_paper(
    plan: Plan, work: Work, out: Path, measured: Path | None, keep: Path | None, watch: Watch = no_watch
) -> tuple[Path, dict[str, Any]]:
    """Compute all claims; write out/paper.html, out/paper.json and out/tables. Returns the page and the JSON's content.

    measured: a folder of measured pushes (see data.measured). keep: a folder that receives all simulated recordings.
    """
    out.mkdir(parents=True, exist_ok=True)
    begun, count = time.monotonic(), len(CLAIMS) + 1

    def begin(number: int, title: str) -> None:
        stage = f"{number}/{count} {title}"
        work.watch = lambda doing, done: watch(f"{stage}: {doing}", (number - 1 + done) / count)
        watch(stage, (number - 1) / count)

    begin(1, "recordings")
    study = gather(plan, work, out, measured, keep)
    sections = []
    for number, (title, section) in enumerate(CLAIMS.items(), 2):
        begin(number, title)
        sections.append(section(study))
    content, files = _content(plan, sections, time.monotonic() - begun), write_tables(out, sections)
    write_whole(out / "paper.json", (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())
    write_whole(out / "paper.html", _page(plan, study, sections, content["made"], files).encode())
    return out / "paper.html", content


def gather(plan: Plan, work: Work, out: Path, measured: Path | None, keep: Path | None) -> Study:
    """Simulate the recordings, find their windows, import the measured sets."""
    simulated = simulated_corpus(plan, work, keep)
    reference = simulated.reference[1]
    again = {s: plan.repetitions if s == reference else plan.other_repetitions for s in plan.surfaces}
    grids = {surface: repeated_grid(plan, work, surface, count, keep) for surface, count in again.items()}
    found = () if measured is None else measured_corpora(measured, work, work.folder / "measured")
    return Study(plan, work, out, simulated, found, grids)


def _content(plan: Plan, sections: list[Section], seconds: float) -> dict[str, Any]:
    return {
        "paper": PAPER,
        "plan": vars(plan),
        "made": {
            "push_predictor": __version__,
            "sources": fingerprint(),
            "python": platform.python_version(),
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "seconds": round(seconds, 1),
        },
        "sections": {s.key: _section_json(s, too_little(plan).get(s.key, "")) for s in sections},
    }


def _section_json(section: Section, lacks: str) -> dict[str, Any]:
    return {
        "title": section.title,
        "place": PLACES.get(section.key),
        "too_little_data": lacks,
        "findings": [vars(finding) for finding in section.findings],
        "tables": [vars(table) for table in section.tables],
        "notes": list(section.notes),
        "data": dict(section.data),
    }


def _page(plan: Plan, study: Study, sections: list[Section], made: Mapping[str, Any], files: Files) -> str:
    lacking = too_little(plan)
    bars = [html.Bar(CLAIM_KINDS[origin].capitalize(), counts(sections, origin, lacking)) for origin in CLAIM_KINDS]
    label = "quick check" if lacking else "full size"
    parts = [
        html.opening(opening_sentences(sections, study, lacking), label, html.shares(bars, COUNTS)),
        *([html.paragraph(QUICK_WARNING, "warning")] if lacking else []),
        *_summary_tables(sections, lacking),
        html.heading("How to read this page"),
        *map(html.paragraph, (f"The paper: {PAPER}.", _origin(study), *HOW_TO_READ)),
    ]
    for section in sections:
        parts += _section_html(section, lacking.get(section.key, ""), files[section.key])
    facts = {name: str(value) for name, value in made.items()} | {"plan": plan.name, "seed": str(plan.seed)}
    parts += [html.heading("How this page was made"), html.definitions(facts)]
    return html.page("Planar pushing: the paper, claim by claim", parts)


def _summary_tables(sections: Sequence[Section], lacking: Mapping[str, str]) -> list[str]:
    """One table of the paper's claims, one of the questions beyond the paper."""
    heads: dict[Origin, str] = {"paper": "claim of the paper", "beyond the paper": "question beyond the paper"}
    tables = []
    for origin, head in heads.items():
        rows = [
            html.VerdictRow(s.key, s.title, f.claim, f.number, f.verdict, s.key in lacking)
            for s in sections
            for f in s.findings
            if f.origin == origin
        ]
        tables += [html.verdicts(head, rows)] if rows else []
    return tables


def _origin(study: Study) -> str:
    measured = "; ".join(corpus.name for corpus in study.measured)
    return f"Data: {study.simulated.title}; " + (measured or "no measured pushes (give them with --data FOLDER)") + "."


def _section_html(section: Section, lacks: str, files: Sequence[Mapping[str, str]]) -> list[str]:
    return [
        html.heading(heading(section.key, section.title), section.key),
        *([html.paragraph(f"Grey: too little data for a verdict ({lacks}).")] if lacks else []),
        *(html.finding(f.claim, f.verdict, f.sentence, bool(lacks)) for f in section.findings),
        *map(html.figure, section.pictures),
        *(html.folded_table(t.caption, t.head, t.rows, f) for t, f in zip(section.tables, files, strict=True)),
        *([html.bullets(section.notes)] if section.notes else []),
    ]

"""The report: every claim of the paper with its figure, its number and whether it holds here; HTML, JSON beside it."""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import scipy

from push_predictor import __version__
from push_predictor.recordings.atomic import write_whole
from push_predictor.reporting import html
from push_predictor_paper.claims import data
from push_predictor_paper.claims.calibration import calibration
from push_predictor_paper.claims.comparison import comparison, mean_gain, speed_error
from push_predictor_paper.claims.divergence import divergence
from push_predictor_paper.claims.learning import learning_curves, variants
from push_predictor_paper.claims.maps import maps
from push_predictor_paper.claims.noise import noise
from push_predictor_paper.claims.quasi_static import quasi_static
from push_predictor_paper.claims.repeated_pushes import kinds_of_push, modality
from push_predictor_paper.data.corpus import simulated_corpus
from push_predictor_paper.data.measured import measured_corpora
from push_predictor_paper.data.repetitions import repeated_grid
from push_predictor_paper.plan import Plan
from push_predictor_paper.section import Origin, Section, Table
from push_predictor_paper.study import Study
from push_predictor_paper.work import Work, fingerprint

PAPER = "Bauza and Rodriguez, A Probabilistic Data-Driven Model for Planar Pushing, ICRA 2017"
CLAIMS: tuple[Callable[[Study], Section], ...] = (
    data.section,
    kinds_of_push.section,
    maps.section,
    noise.section,
    learning_curves.section,
    comparison.section,
    mean_gain.section,
    speed_error.section,
    divergence.section,
    modality.section,
    quasi_static.section,
    calibration.section,
    variants.section,
)
HOW_TO_READ = (
    "Intervals are 95 %. Windows of one push are not independent: intervals draw whole pushes anew or span seeds and "
    "folds, as each caption says, and the split that counts leaves whole pushes out. A random split of windows is "
    "shown beside it because the paper used one.",
    "NMSE and NLPD are sums over dx, dy and dtheta. NLPD is in SI units (m, m, rad); in mm and rad it is 13.8155 more.",
    "A verdict follows from the numbers by the rule that its sentence tells. Simulated and measured pushes never share "
    "a table. What holds in our simulator shows that the method works and that the physics suffices for the effect, "
    "not that the world is so.",
)


class Stages(Protocol):
    """Hears which part of the report is being made."""

    def stage(self, number: int, of: int, title: str) -> None:
        """A part begins."""


def report_paper(
    plan: Plan, work: Work, out: Path, measured: Path | None, keep: Path | None, stages: Stages
) -> tuple[Path, dict[str, Any]]:
    """Compute everything and write out/paper.html, its pictures, out/paper.json; returns page and content of the JSON.

    measured: a folder of measured pushes (paper.measured). keep: a folder that receives all simulated recordings.
    """
    out.mkdir(parents=True, exist_ok=True)
    begun, count = time.monotonic(), len(CLAIMS) + 1
    stages.stage(1, count, "recordings")
    study = gather(plan, work, out, measured, keep)
    sections = []
    for number, claim in enumerate(CLAIMS, 2):
        stages.stage(number, count, claim.__module__.rpartition(".")[2].replace("_", " "))
        sections.append(claim(study))
    content = _content(plan, sections, time.monotonic() - begun)
    write_whole(out / "paper.json", (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())
    write_whole(out / "paper.html", _page(plan, study, sections, content["made"]).encode())
    return out / "paper.html", content


def gather(plan: Plan, work: Work, out: Path, measured: Path | None, keep: Path | None) -> Study:
    """All data: recordings simulated and their windows cut, measured sets imported."""
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
        "sections": {s.key: _section_json(s) for s in sections},
    }


def _section_json(section: Section) -> dict[str, Any]:
    return {
        "title": section.title,
        "findings": [vars(finding) for finding in section.findings],
        "tables": [vars(table) for table in section.tables],
        "notes": list(section.notes),
        "data": dict(section.data),
    }


def _page(plan: Plan, study: Study, sections: list[Section], made: Mapping[str, Any]) -> str:
    parts = [
        html.paragraph(f"What {PAPER} reports, made again from {_origin(study)}.", "lead"),
        *([html.paragraph(QUICK_WARNING, "warning")] if plan.name == "quick" else []),
        *map(html.paragraph, HOW_TO_READ),
        html.heading("What holds here"),
        *_summary(sections),
    ]
    for section in sections:
        parts += _section_html(section)
    facts = {name: str(value) for name, value in made.items()} | {"plan": plan.name, "seed": str(plan.seed)}
    parts += [html.heading("How this was made"), html.definitions(facts)]
    return html.page("Planar pushing: the paper, claim by claim", parts)


def _summary(sections: Sequence[Section]) -> list[str]:
    """What the paper claims, and what is asked beyond it, in a table each."""
    heads: dict[Origin, str] = {"paper": "claim of the paper", "beyond the paper": "asked beyond the paper"}
    tables = []
    for origin, head in heads.items():
        rows = [(s.key, s.title, f.claim, f.verdict) for s in sections for f in s.findings if f.origin == origin]
        tables += [html.verdicts(head, rows)] if rows else []
    return tables


QUICK_WARNING = (
    "Made with --quick: a few small recordings, to see that everything runs. Its intervals are wide and its verdicts "
    "are those of little data; without --quick the paper's full size is made."
)


def _origin(study: Study) -> str:
    measured = "; ".join(corpus.name for corpus in study.measured)
    return study.simulated.title + (
        f"; and {measured}" if measured else "; no measured data were given (--data FOLDER)"
    )


def _section_html(section: Section) -> list[str]:
    return [
        html.heading(section.title, section.key),
        *(html.finding(f.claim, f.verdict, f.sentence) for f in section.findings),
        *map(html.figure, section.pictures),
        *map(_table_html, section.tables),
        *([html.bullets(section.notes)] if section.notes else []),
    ]


def _table_html(table: Table) -> str:
    return html.table(table.caption, table.head, table.rows)

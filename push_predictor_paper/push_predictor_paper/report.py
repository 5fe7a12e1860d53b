# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The report: every claim of the paper with picture, numbers and verdict, as HTML and as JSON."""

from __future__ import annotations

import json
import platform
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from push_predictor import __version__
from push_predictor.recordings.atomic import write_whole
from push_predictor.reporting import html
from push_predictor.reporting.canvas import Picture
from push_predictor.watch import Watch, no_watch
from push_predictor_paper.claims import CLAIMS, ENOUGH
from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.plan import Plan
from push_predictor_paper.section import Section, Table, TooFewError
from push_predictor_paper.sections import (
    comparison,
    data,
    divergence,
    kinds_of_push,
    learning_curves,
    maps,
    modality,
    noise,
    quasi_static,
    speed_error,
)
from push_predictor_paper.study import Study, gather
from push_predictor_paper.verdict import RULE, VERDICTS, Evidence, Finding, judged
from push_predictor_paper.work import Work, fingerprint

PAPER = "Bauza and Rodriguez, A Probabilistic Data-Driven Model for Planar Pushing, ICRA 2017"
TITLES = {
    "data": "The data",
    "kinds_of_push": "Three kinds of push",
    "maps": "Maps of mean and standard deviation",
    "noise": "Size, range and shape of the noise",
    "learning_curves": "Learning curves: surfaces and shapes",
    "comparison": "Analytical model, GP and VHGP",
    "speed_error": "Error against speed",
    "divergence": "KL divergence between repeated pushes and models",
    "modality": "Single pushes: histograms and modes",
    "quasi_static": "The quasi-static assumption: pushes of all speeds scaled to 10 mm/s",
}
OF_STUDY: Mapping[str, Callable[[Study], Section]] = {
    "data": data.section,
    "kinds_of_push": kinds_of_push.section,
    "maps": maps.section,
    "noise": noise.section,
    "divergence": divergence.section,
    "modality": modality.section,
    "quasi_static": quasi_static.section,
}
OF_CORPUS: Mapping[str, Callable[[Study, Corpus], Section]] = {  # of simulated pushes, and of each measured set
    "learning_curves": learning_curves.section,
    "comparison": comparison.section,
    "speed_error": speed_error.section,
}
WORDS = {  # of one claim, of several
    "holds": ("holds", "hold"),
    "holds in part": ("holds in part", "hold in part"),
    "does not hold": ("does not hold", "do not hold"),
    "not decided": ("is not decided", "are not decided"),
}
HOW_TO_READ = (
    RULE,
    "Windows of one push are not independent. Intervals therefore resample whole pushes, or span seeds and folds, "
    "as each caption states. The split that counts holds out whole pushes. The paper used a random split of "
    "windows; it is shown for comparison.",
    "NMSE and NLPD are sums over dx, dy and dtheta. NLPD is in SI units (m, m, rad). In mm and rad it is 13.8155 "
    "higher.",
    "Simulated and measured pushes never share a table. A claim that holds in the simulator shows that the method "
    "works and that the simulated physics suffices for the effect. It does not show that real pushes behave so.",
)
QUICK_WARNING = (
    "Made with `--quick`: a few small recordings, at most 400 training windows, speeds up to 200 mm/s. Intervals are "
    "wide, and verdicts may differ from those of the paper's full size, which is computed without `--quick`."
)
COUNTS = "Number of verdicts. Each claim and its number are in the table below."


@dataclass
class Checked:
    """A section with the verdicts on its claims."""

    findings: list[Finding]
    tables: list[Table]
    pictures: list[Picture]
    notes: list[str]


def report_paper(
    plan: Plan, work: Work, out: Path, measured: Path | None, keep: Path | None, watch: Watch = no_watch
) -> tuple[Path, dict[str, Any]]:
    """Compute all claims; write out/paper.html, out/paper.json and out/tables. Returns the page and the JSON's content.

    measured: a folder of measured pushes (see data.measured). keep: a folder that receives all simulated recordings.
    """
    out.mkdir(parents=True, exist_ok=True)
    begun, count = time.monotonic(), len(TITLES) + 1

    def begin(number: int, title: str) -> None:
        stage = f"{number}/{count} {title}"
        work.watch = lambda doing, done: watch(f"{stage}: {doing}", (number - 1 + done) / count)
        watch(stage, (number - 1) / count)

    begin(1, "recordings")
    study = gather(plan, work, out, measured, keep)
    sections = {}
    for number, key in enumerate(TITLES, 2):
        begin(number, key.replace("_", " "))
        sections[key] = checked(key, study)
    made = {
        "push_predictor": __version__,
        "sources": fingerprint(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "seconds": round(time.monotonic() - begun, 1),
    }
    content = {
        "paper": PAPER,
        "plan": vars(plan),
        "made": made,
        "verdicts": _counts(sections),
        "sections": {key: _section_json(key, section) for key, section in sections.items()},
    }
    (out / "tables").mkdir(exist_ok=True)
    for key, section in sections.items():
        for name, table in zip(_files(key, section), section.tables, strict=True):
            write_whole(out / name, table.csv().encode())
    write_whole(out / "paper.json", (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())
    write_whole(out / "paper.html", _page(study, sections, made).encode())
    return out / "paper.html", content


def checked(key: str, study: Study) -> Checked:
    """Compute a section, and judge all its claims: of the whole study, or of each of its corpora."""
    found = Checked([], [], [], [])
    for corpus in study.corpora if key in OF_CORPUS else (None,):
        section = _section(key, study, corpus)
        of = corpus.name if corpus else ""
        found.findings += [judged(claim, section.evidence[name], of) for name, claim in CLAIMS[key].items()]
        found.tables += section.tables
        found.pictures += section.pictures
        found.notes += [note for note in section.notes if note not in found.notes]
    return found


def _section(key: str, study: Study, corpus: Corpus | None) -> Section:
    try:
        return OF_CORPUS[key](study, corpus) if corpus else OF_STUDY[key](study)
    except TooFewError as error:
        return Section({claim: Evidence(note=str(error)) for claim in CLAIMS[key]})


def _files(key: str, section: Checked) -> list[str]:
    """The address of the CSV file of every table, relative to the page."""
    return [f"tables/{key}_{k + 1}.csv" for k in range(len(section.tables))]


def _section_json(key: str, section: Checked) -> dict[str, Any]:
    return {
        "title": TITLES[key],
        "findings": [finding.json() for finding in section.findings],
        "tables": [table.json() for table in section.tables],
        "notes": section.notes,
    }


def _counts(sections: Mapping[str, Checked]) -> dict[str, int]:
    found = Counter(finding.verdict for section in sections.values() for finding in section.findings)
    return {verdict: found[verdict] for verdict in VERDICTS}


def _page(study: Study, sections: Mapping[str, Checked], made: Mapping[str, Any]) -> str:
    plan, quick = study.plan, study.plan.size < ENOUGH
    found = _counts(sections)
    bars = [html.Bar("Claims of the paper", found)]
    rows = [
        html.VerdictRow(key, TITLES[key], f.claim, f.number, f.verdict)
        for key, section in sections.items()
        for f in section.findings
    ]
    measured = (
        "; ".join(corpus.name for corpus in study.measured) or "no measured pushes (give them with --data FOLDER)"
    )
    data_used = f"Data: {study.simulated.title}; {measured}."
    label = "quick check" if quick else "full size"
    parts = [
        html.opening(_opening(study, found, quick), label, html.shares(bars, COUNTS)),
        *([html.paragraph(QUICK_WARNING, "warning")] if quick else []),
        html.verdicts("claim of the paper", rows),
        html.heading("How to read this page"),
        *map(html.paragraph, (f"The paper: {PAPER}.", data_used, *HOW_TO_READ)),
    ]
    for key, section in sections.items():
        parts += _section_html(key, section)
    facts = {name: str(value) for name, value in made.items()} | {"plan": plan.name, "seed": str(plan.seed)}
    parts += [html.heading("How this page was made"), html.definitions(facts)]
    return html.page("Planar pushing: the paper, claim by claim", parts)


def _opening(study: Study, found: Mapping[str, int], quick: bool) -> tuple[str, str, str]:
    """How many of the paper's claims hold, on which pushes that rests, what to do."""
    parts = [f"{found[verdict]} {WORDS[verdict][found[verdict] > 1]}" for verdict in VERDICTS if found[verdict]]
    claims = f"Of {sum(found.values())} claims of the paper, {', '.join(parts)}."
    measured = ", ".join(corpus.name.removeprefix("measured: ") for corpus in study.measured)
    also = f", and on measured ones ({measured})" if measured else ""
    data_used = f"They are checked on simulated pushes of {len(study.simulated.sets)} sets of shape and surface{also}."
    next_step = (
        "Run the report without `--quick` for verdicts at the paper's size."
        if quick
        else "Read the number of each claim below; its section has the range that the claim requires."
    )
    return claims, data_used, next_step


def _section_html(key: str, section: Checked) -> list[str]:
    places = ", ".join(dict.fromkeys(finding.place for finding in section.findings))
    files = [{"CSV": name} for name in _files(key, section)]
    return [
        html.heading(f"{TITLES[key]} (paper: {places})", key),
        *(html.finding(f.claim, f.verdict, f.sentence) for f in section.findings),
        *map(html.figure, section.pictures),
        *(html.folded_table(t.caption, t.head, t.texts, f) for t, f in zip(section.tables, files, strict=True)),
        *([html.bullets(section.notes)] if section.notes else []),
    ]

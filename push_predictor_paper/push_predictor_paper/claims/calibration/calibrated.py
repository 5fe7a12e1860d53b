# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Coverage, PIT histograms and density gains of the models of one corpus."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from push_predictor.evaluation.metrics import COVERAGE_LEVELS
from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.estimate import Estimate, by_push, total_exact_nlpd, total_nlpd
from push_predictor_paper.fits.fit import KINDS, SPLITS, Fit, SplitName, trainable
from push_predictor_paper.statistics.pit import Histogram, Pits, coverage, histogram, pits, together
from push_predictor_paper.study import Study

EXACT = "VHGP, exact"
MODELS = {"analytical": "analytical", "GP": "gp", "VHGP, Gaussian": "vhgp", EXACT: "vhgp"}  # shown: trained
Key = tuple[str, SplitName]  # one of MODELS


@dataclass(frozen=True, eq=False)
class Calibrated:
    """The calibration of one corpus' models.

    judged: the windows of all seeds and folds together, by kind and split. coverages: [level][output]. gains: exact
    minus Gaussian NLPD of the VHGP, sum of the outputs.
    """

    corpus: Corpus
    size: int
    judged: Mapping[tuple[str, SplitName], Pits]
    coverages: Mapping[Key, Sequence[Sequence[Estimate]]]
    shapes: Mapping[Key, Histogram]
    gains: Mapping[SplitName, Estimate]

    @property
    def name(self) -> str:
        """Short, for a claim."""
        return f"{self.corpus.name}, {' on '.join(self.corpus.reference)}"

    def windows(self, split: SplitName) -> str:
        """The numbers of test windows and pushes, in words."""
        judged = self.judged["vhgp", split]
        return f"{len(judged.push_id)} windows of {len(judged.push_scores.push_id)} pushes"


def calibrated(study: Study, corpus: Corpus) -> Calibrated | None:
    """Train and score the models of the reference set; None if it is too small for every size of the plan."""
    size = fitting_size(study, corpus)
    if size is None:
        return None
    judged = _judged(study, corpus, size)
    coverages, shapes = {}, {}
    for model, kind in MODELS.items():
        for split in SPLITS:
            windows = judged[kind, split]
            probabilities = windows.exact if model == EXACT else windows.gaussian
            coverages[model, split] = [coverage(windows.push_id, probabilities, level) for level in COVERAGE_LEVELS]
            shapes[model, split] = histogram(windows.push_id, probabilities)
    gains = {split: density_gain(judged["vhgp", split]) for split in SPLITS}
    return Calibrated(corpus, size, judged, coverages, shapes, gains)


def fitting_size(study: Study, corpus: Corpus) -> int | None:
    """The largest size of the plan that every split of the reference set can train on."""
    pushes = corpus.sets[corpus.reference]
    most = min(trainable(pushes, Fit("gp", 0, split, seed)) for split in SPLITS for seed in range(study.plan.seeds))
    return max((n for n in study.plan.sizes if n <= most), default=None)


def density_gain(judged: Pits) -> Estimate:
    """Exact minus Gaussian NLPD, sum of the outputs, of the same windows."""
    return by_push(judged.push_scores, lambda totals: total_exact_nlpd(totals) - total_nlpd(totals))


def _judged(study: Study, corpus: Corpus, size: int) -> dict[tuple[str, SplitName], Pits]:
    seeds, pushes = range(study.plan.seeds), corpus.sets[corpus.reference]
    fits = [Fit(kind, size, split, seed) for kind in KINDS for split in SPLITS for seed in seeds]
    found = dict(zip(fits, study.work.run("calibration", pits, [(pushes, fit) for fit in fits]), strict=True))
    return {(k, s): together([found[Fit(k, size, s, seed)] for seed in seeds]) for k in KINDS for s in SPLITS}

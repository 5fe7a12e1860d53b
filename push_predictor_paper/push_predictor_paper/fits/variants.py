# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Other kernels than the plain squared exponential for the VHGP, scored like every other fit."""

from __future__ import annotations

import time

import numpy as np

from push_predictor.evaluation.push_scores import push_scores
from push_predictor.evaluation.validation import compare
from push_predictor.models.gaussian_process.kernels import DEFAULT_CHOICE, KernelChoice
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor_paper.data.corpus import Corpus, PushSet
from push_predictor_paper.fits.fit import SPLITS, Fit, Score, scores, split_of, trainable
from push_predictor_paper.plan import Plan
from push_predictor_paper.work import Work

PLAIN = "squared exponential"
CHOICES = {
    PLAIN: KernelChoice("squared_exponential", False),
    "squared exponential + nugget": KernelChoice("squared_exponential", True),
    "Matérn-5/2": KernelChoice("matern52", False),
    "Matérn-5/2 + nugget": KernelChoice("matern52", True),
}
SIZES = (100, 500, 1000)
LARGE, SEEDS_OF_LARGE = 1000, 3  # a fit of 1000 rows takes long


def variant_scores(plan: Plan, work: Work, corpus: Corpus) -> dict[tuple[str, Fit], Score]:
    """Train and score every choice of kernels on the same rows of the reference set."""
    fits, pushes = variant_fits(plan, corpus), corpus.sets[corpus.reference]
    found: dict[tuple[str, Fit], Score] = {}
    for name, choice in CHOICES.items():
        if choice == DEFAULT_CHOICE:  # the learning curves have computed most of these
            made = list(scores(work, corpus, [(corpus.reference, fit) for fit in fits]).values())
        else:
            made = work.run(f"models, {name}", score_variant, [(pushes, fit, choice) for fit in fits])
        found |= {(name, fit): score for fit, score in zip(fits, made, strict=True)}
    return found


def variant_fits(plan: Plan, corpus: Corpus) -> list[Fit]:
    """Sizes that the plan reaches and every split of the reference set can train on; few seeds of large ones."""
    pushes = corpus.sets[corpus.reference]
    fits: list[Fit] = []
    for n in (n for n in SIZES if n <= plan.size):
        seeds = range(min(plan.seeds, SEEDS_OF_LARGE) if n >= LARGE else plan.seeds)
        of_size = [Fit("vhgp", n, split, seed) for split in SPLITS for seed in seeds]
        fits += of_size if all(n <= trainable(pushes, fit) for fit in of_size) else []
    return fits


def score_variant(pushes: PushSet, fit: Fit, choice: KernelChoice) -> Score:
    """Train and score a VHGP with other kernels."""
    split = split_of(pushes, fit)
    table = pushes.table.take(np.sort(split.first(fit.n)))
    start = time.process_time()
    model = train_model(
        table,
        pushes.rig,
        fit.kind,
        name=fit.kind,
        options=TrainingOptions(n_train=fit.n, seed=fit.seed, kernels=choice, mean="zero", per_path=False, tails=False),
    )
    cpu = time.process_time() - start
    return Score(fit, push_scores(compare(model, pushes.table.take(split.test))), cpu)

"""A regression of one output: any of the Gaussian processes of this folder."""

from __future__ import annotations

from typing import TypeAlias

from push_predictor.models.gaussian_process.gp import GaussianProcess
from push_predictor.models.gaussian_process.sparse.vhgp import SparseVHGP
from push_predictor.models.gaussian_process.vhgp import VHGP

Regression: TypeAlias = GaussianProcess | VHGP | SparseVHGP

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

"""Kernels with automatic relevance determination: squared exponential and Matern-5/2, values and derivatives.

    r^2 = sum_d ((x_d - x'_d) / l_d)^2
    k(x, x') = s^2 exp(-r^2 / 2)                            squared exponential
    k(x, x') = s^2 (1 + t + t^2 / 3) exp(-t), t = 5^1/2 r   Matern-5/2 (Rasmussen and Williams 2006, eq. 4.17)

Both hyperparameters are stored as logarithms. No derivative is formed as a matrix: `gradient` contracts a weight matrix
with all of them at once.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal

import numpy as np

from push_predictor.models.gaussian_process.matrices.triangles import BLOCK, mirror_upper, upper_blocks
from push_predictor.types import Array

KernelFamily = Literal["squared_exponential", "matern52"]


@dataclass(frozen=True)
class KernelChoice:
    """The kernels of a regression: the family of both, and whether the noise process has a nugget.

    A nugget is variance of the log noise that is independent from row to row; a standard GP has none.
    """

    family: KernelFamily = "squared_exponential"
    noise_nugget: bool = False


DEFAULT_CHOICE = KernelChoice()


@dataclass(frozen=True)
class ArdKernel(ABC):
    """A kernel of r; log_lengthscales (D,), log_sd the log of the standard deviation s."""

    log_lengthscales: Array
    log_sd: float

    @property
    def variance(self) -> float:
        """k(x, x), the same for every x."""
        return float(np.exp(2.0 * self.log_sd))

    def matrix(self, inputs: Array) -> Array:
        """Kernel between all rows of inputs (n, D), shape (n, n), exactly symmetric."""
        z = self._scaled(inputs)
        kernel = np.empty((len(z), len(z)))
        for rows, columns in upper_blocks(len(z)):
            kernel[rows, columns] = self._values(_exponents(z[rows], z[columns]))
        return mirror_upper(kernel)

    def cross(self, left: Array, right: Array) -> Array:
        """Kernel between the rows of left (n, D) and right (m, D), shape (n, m)."""
        a, b = self._scaled(left), self._scaled(right)
        if len(a) == 1:
            return self._values(-0.5 * ((a - b) ** 2).sum(axis=1)[None, :])
        kernel = np.empty((len(a), len(b)))
        for start in range(0, len(a), BLOCK):
            kernel[start : start + BLOCK] = self._values(_exponents(a[start : start + BLOCK], b))
        return kernel

    def gradient(self, inputs: Array, matrix: Array, weights: Array) -> Array:
        """sum_ij weights_ij d matrix_ij / d(log_lengthscales, log_sd), shape (D + 1,).

        inputs (n, D); matrix is `self.matrix(inputs)`; weights (n, n) symmetric, of which the upper triangle is read.
        """
        z = self._scaled(inputs)
        of_lengthscales, of_sd = np.zeros(z.shape[1]), 0.0
        for rows, columns in upper_blocks(len(z)):
            contracted = weights[rows, columns] * matrix[rows, columns]
            _count_once(contracted)
            of_sd += 4.0 * float(contracted.sum())
            of_lengthscales += 2.0 * _spread(self._sloped(contracted, z[rows], z[columns]), z[rows], z[columns])
        return np.append(of_lengthscales, of_sd)

    def _scaled(self, inputs: Array) -> Array:
        return inputs * np.exp(-self.log_lengthscales)

    @property
    @abstractmethod
    def smooth(self) -> bool:
        """Whether it has derivatives of all orders, so that matrices of many rows are of low rank."""

    @abstractmethod
    def _values(self, exponents: Array) -> Array:
        """The kernel at exponents -r^2 / 2, whose memory it may use."""

    @abstractmethod
    def _sloped(self, contracted: Array, a: Array, b: Array) -> Array:
        """Weights times the kernel's derivative wrt the exponents.

        contracted: weights times the kernel, whose memory it may use; a, b: the scaled rows that it is between.
        """


@dataclass(frozen=True)
class SquaredExponential(ArdKernel):
    """ARD squared exponential."""

    smooth = True

    def _values(self, exponents: Array) -> Array:
        exponents += 2.0 * self.log_sd
        return np.asarray(np.exp(exponents, out=exponents))

    def _sloped(self, contracted: Array, a: Array, b: Array) -> Array:
        return contracted


@dataclass(frozen=True)
class Matern52(ArdKernel):
    """ARD Matern-5/2: of functions with two derivatives, where a squared exponential's have all."""

    smooth = False

    def _values(self, exponents: Array) -> Array:
        t = _root(exponents)
        polynomial = t / 3.0
        polynomial += 1.0
        polynomial *= t
        polynomial += 1.0
        np.subtract(2.0 * self.log_sd, t, out=t)
        polynomial *= np.exp(t, out=t)
        return polynomial

    def _sloped(self, contracted: Array, a: Array, b: Array) -> Array:
        # 5/3 (1 + t) over (1 + t + t^2 / 3), which is the kernel's polynomial
        t = _root(_exponents(a, b))
        steeper = t + 1.0
        t *= t
        t /= 3.0
        t += steeper
        steeper *= 5.0 / 3.0
        contracted *= steeper
        contracted /= t
        return contracted


_FAMILIES: dict[KernelFamily, type[ArdKernel]] = {"squared_exponential": SquaredExponential, "matern52": Matern52}
FAMILIES = tuple(_FAMILIES)


def ard_kernel(family: KernelFamily, log_lengthscales: Array, log_sd: float) -> ArdKernel:
    """The kernel of a family with these hyperparameters."""
    return _FAMILIES[family](log_lengthscales, log_sd)


def _exponents(a: Array, b: Array) -> Array:
    """-1/2 |a_i - b_j|^2 of the rows of a (n, D) and b (m, D), shape (n, m)."""
    exponents = a @ b.T
    exponents -= 0.5 * (a * a).sum(axis=1)[:, None] + 0.5 * (b * b).sum(axis=1)
    return np.minimum(exponents, 0.0, out=exponents)  # at r = 0 rounding may leave a tiny positive one


def _root(exponents: Array) -> Array:
    """5^1/2 r, in the memory of the exponents -r^2 / 2."""
    exponents *= -10.0
    return np.asarray(np.sqrt(exponents, out=exponents))


def _count_once(block: Array) -> None:
    """Clear the block (k, m) of an upper triangle below the diagonal and halve it there: twice its sum is the whole."""
    square = block[:, : len(block)]
    square[:] = np.triu(square)
    square.flat[:: len(block) + 1] *= 0.5


def _spread(weights: Array, a: Array, b: Array) -> Array:
    """sum_ij weights_ij (a_i - b_j)^2 for each input, shape (D,)."""
    squares = weights.sum(axis=1) @ (a * a) + weights.sum(axis=0) @ (b * b)
    return np.asarray(squares - 2.0 * (a * (weights @ b)).sum(axis=0))

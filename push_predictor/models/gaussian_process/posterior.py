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

"""The posterior of a zero-mean Gaussian process seen through independent noise, at new inputs."""

from __future__ import annotations

import numpy as np
import scipy

from push_predictor.models.gaussian_process.matrices.ridge import cholesky_in_place
from push_predictor.types import Array


class KernelPosterior:
    """Posterior for a kernel matrix (n, n) between training inputs and noise variances (n,), any kernel.

    After construction a prediction costs one triangular solve. Raises numpy's LinAlgError when the kernel
    matrix plus noise is not positive definite.
    """

    def __init__(self, kernel_matrix: Array, noise_variances: Array) -> None:
        regularised = np.array(kernel_matrix, order="C")
        regularised.flat[:: len(regularised) + 1] += noise_variances
        self._factor = cholesky_in_place(regularised)

    def weights(self, values: Array) -> Array:
        """(K + noise)^-1 values, shape (n,): the posterior mean at x* is k(x*, X) times this."""
        half = scipy.linalg.blas.dtrsv(self._factor, values, lower=1)
        return np.asarray(scipy.linalg.blas.dtrsv(self._factor, half, lower=1, trans=1))

    def explained_variance(self, cross: Array) -> Array:
        """By how much the observations reduce the prior variance at m inputs, shape (m,).

        cross (m, n): kernel between the new inputs and the training inputs. The result is
        diag(cross (K + noise)^-1 cross').
        """
        if len(cross) == 1:
            half = scipy.linalg.blas.dtrsv(self._factor, cross[0], lower=1)
            return np.array([half @ half])
        half = scipy.linalg.blas.dtrsm(1.0, self._factor, cross.T, lower=1)
        return np.asarray(np.einsum("ij,ij->j", half, half))

    def explained_covariance(self, cross: Array) -> Array:
        """By how much the observations reduce the prior covariance between m inputs, (m, m); cross (m, n) as above."""
        half = scipy.linalg.blas.dtrsm(1.0, self._factor, cross.T, lower=1)
        return np.asarray(half.T @ half)

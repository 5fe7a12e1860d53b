# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Fits of other libraries on standardised rows; benchmarks.models.peers runs this script in their interpreter.

    python benchmarks/models/peer_fits.py KIND ROWS.npz PREDICTIONS.npz        KIND: gpflow | hetgpy

ROWS has x (n, D), y (n, k), new (q, D), inducing and steps. PREDICTIONS receives mean, variance, log_noise_mean and
log_noise_variance, (q, k) each, the library's version, and seconds, the CPU time of fitting without imports. The script
imports the standard library, numpy and the peer, and nothing of this project.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Predict = Callable[[Array], tuple[Array, Array, Array, Array]]  # means and variances of signal and log noise
Fit = Callable[[Array, Array, int, int], Predict]  # of inputs, outputs, number of inducing inputs, steps
NAMES = ("mean", "variance", "log_noise_mean", "log_noise_variance")


def main() -> None:
    """Fit each output, predict, save."""
    kind, rows, predictions = sys.argv[1:]
    with np.load(rows) as file:
        x, outputs, new, inducing, steps = (file[name] for name in ("x", "y", "new", "inducing", "steps"))
    fit, version = FITS[kind]()
    start = time.process_time()
    predictors = [fit(x, column, int(inducing), int(steps)) for column in outputs.T]
    seconds = time.process_time() - start
    columns = [predict(new) for predict in predictors]
    found: dict[str, Any] = {name: np.column_stack([column[k] for column in columns]) for k, name in enumerate(NAMES)}
    np.savez(predictions, **found, seconds=seconds, version=version)


def gpflow_fit() -> tuple[Fit, str]:
    """GPflow's heteroskedastic SVGP, as in its own notebook.

    Natural gradients for q(f, g), Adam for kernels and inducing inputs, which begin at random rows. Its g is the log of
    the noise's standard deviation.
    """
    import gpflow
    import tensorflow as tf

    tf.config.threading.set_intra_op_parallelism_threads(1)
    tf.config.threading.set_inter_op_parallelism_threads(1)

    def fit(x: Array, y: Array, inducing: int, steps: int) -> Predict:
        kernels = [gpflow.kernels.SquaredExponential(lengthscales=np.ones(x.shape[1])) for _ in range(2)]
        chosen = x[np.random.default_rng(0).permutation(len(x))[:inducing]]
        points = [gpflow.inducing_variables.InducingPoints(chosen.copy()) for _ in range(2)]
        model = gpflow.models.SVGP(
            kernel=gpflow.kernels.SeparateIndependent(kernels),
            likelihood=gpflow.likelihoods.HeteroskedasticTFPConditional(),
            inducing_variable=gpflow.inducing_variables.SeparateIndependentInducingVariables(points),
            num_latent_gps=2,
        )
        gpflow.set_trainable(model.q_mu, False)
        gpflow.set_trainable(model.q_sqrt, False)
        loss = model.training_loss_closure((x, y[:, None]))
        natural, adam = gpflow.optimizers.NaturalGradient(gamma=0.1), tf.keras.optimizers.Adam(0.01)

        def step() -> None:
            natural.minimize(loss, [(model.q_mu, model.q_sqrt)])
            with tf.GradientTape() as tape:
                value = loss()
            variables = model.trainable_variables
            adam.apply_gradients(zip(tape.gradient(value, variables), variables, strict=True))

        compiled = tf.function(step)
        for _ in range(steps):
            compiled()

        def predict(new: Array) -> tuple[Array, Array, Array, Array]:
            mean, variance = (values.numpy() for values in model.predict_f(new))
            return mean[:, 0], variance[:, 0], 2.0 * mean[:, 1], 4.0 * variance[:, 1]

        return predict

    return fit, gpflow.__version__


def hetgpy_fit() -> tuple[Fit, str]:
    """hetgpy, a port of R's hetGP for repeated inputs; its noise is one value per input."""
    from importlib.metadata import version

    from hetgpy import hetGP

    def fit(x: Array, y: Array, inducing: int, steps: int) -> Predict:
        model = hetGP()
        model.mleHetGP(x, y, covtype="Gaussian")

        def predict(new: Array) -> tuple[Array, Array, Array, Array]:
            found = model.predict(new)
            return found["mean"], found["sd2"], np.log(found["nugs"]), np.zeros(len(new))

        return predict

    return fit, version("hetgpy")


FITS = {"gpflow": gpflow_fit, "hetgpy": hetgpy_fit}

if __name__ == "__main__":
    main()

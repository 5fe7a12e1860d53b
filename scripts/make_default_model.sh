#!/bin/sh
# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# Retrains the model shipped with the package on the simulated recording: scripts/make_default_model.sh
set -eu
cd "$(dirname "$0")/.."
PYTHONPATH=. exec "${PYTHON:-.venv/bin/python}" -m push_predictor.cli train bags/square_abs_train --kind vhgp --mean zero \
  --out resource/simulated_square_abs.pushmodel --force

#!/bin/sh
# Trains the model that ships with the package anew, from the simulator's recording: scripts/make_default_model.sh
set -eu
cd "$(dirname "$0")/.."
PYTHONPATH=. exec "${PYTHON:-.venv/bin/python}" -m push_predictor.cli train bags/square_abs_train --kind vhgp \
  --out resource/simulated_square_abs.pushmodel

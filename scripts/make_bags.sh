#!/bin/sh
# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

# Writes the recordings in bags/ again: scripts/make_bags.sh [NAME...]. Seeds are fixed, so the files are identical.
set -eu
cd "$(dirname "$0")/.."
python="${PYTHON:-.venv/bin/python}"
names="${*:-square_abs_train square_abs_test square_abs_repeats ellipse_plywood circle_pu hexagon_delrin}"
for name in $names; do rm -rf "bags/$name"; done
PYTHONPATH=. exec "$python" -m push_predictor.simulation.standard_bags --out bags $names

#!/bin/sh
# Makes the recordings in bags/ anew: scripts/make_bags.sh [NAME...]. Seeds are fixed, so are the recordings.
set -eu
cd "$(dirname "$0")/.."
python="${PYTHON:-.venv/bin/python}"
names="${*:-square_abs_train square_abs_test square_abs_repeats ellipse_plywood circle_pu hexagon_delrin}"
for name in $names; do rm -rf "bags/$name"; done
PYTHONPATH=. exec "$python" -m push_predictor.simulation.standard_bags --out bags $names

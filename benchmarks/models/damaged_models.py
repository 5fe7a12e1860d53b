"""Damage copies of model files at random, seeded, and count what becomes of them: `--copies 2000` of each kind.

    python -m benchmarks.models.damaged_models --copies 2000

A copy is refused by ModelFileError, or answers exactly as the whole file does. Anything else ends the run with the seed
and the number of the copy. CI makes 60 of each kind in test/faults/test_faults_models.py.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

TESTS = Path(__file__).resolve().parents[2] / "test"
sys.path[:0] = [str(TESTS / "faults"), str(TESTS / "support")]

from test_faults_models import KINDS, damaged, same, told, trained  # noqa: E402 (after the path)

from push_predictor.errors import ModelFileError  # noqa: E402 (after the path)
from push_predictor.models.store.model_file import load_model, save_model  # noqa: E402 (after the path)


def main() -> None:
    """Print, for each kind of model, how many copies were refused and how many answered as before."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--copies", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        files = {kind: Path(name) / f"{kind}.model" for kind in KINDS}
        for kind, model in trained().items():
            save_model(model, files[kind])
        for kind in KINDS:
            begun = time.perf_counter()
            refused, answered, slowest = judged(files, kind, options.copies, options.seed)
            print(
                f"{kind}: {refused} refused, {answered} answer as the whole one, longest {slowest:.2f} s, "
                f"{time.perf_counter() - begun:.0f} s"
            )


def judged(files: dict[str, Path], kind: str, copies: int, seed: int) -> tuple[int, int, float]:
    """Refused, answered, longest load in s. Raises SystemExit for a copy that is neither."""
    whole, other = files[kind].read_bytes(), files["vhgp" if kind == "gp" else "gp"].read_bytes()
    expected, rng = told(load_model(files[kind])), np.random.default_rng(seed)
    path, refused, slowest = files[kind].with_name("damaged.model"), 0, 0.0
    for number in range(copies):
        path.write_bytes(damaged(whole, other, rng))
        begun = time.perf_counter()
        try:
            model = load_model(path)
        except ModelFileError:
            refused += 1
        else:
            if not same(told(model), expected):
                sys.exit(f"{kind}, seed {seed}, copy {number}: other numbers")
        slowest = max(slowest, time.perf_counter() - begun)
    return refused, copies - refused, slowest


if __name__ == "__main__":
    main()

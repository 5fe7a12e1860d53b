"""Models against pushes measured by others: the tables of docs/results/measured.md.

Run `python -m benchmarks.measured` and `python -m benchmarks.measured.ladder`; the models' benchmarks import `square`.
"""

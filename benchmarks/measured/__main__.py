"""`python -m benchmarks.measured`: see tables.py."""

from benchmarks.measured.tables import main

main()

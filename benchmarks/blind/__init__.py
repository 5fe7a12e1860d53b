"""The residual loop and the alarm on simulated recordings whose hidden effect they cannot see.

Run `python -m benchmarks.blind`; the demo and the alarm's benchmark import `recordings` and `effects`.
"""

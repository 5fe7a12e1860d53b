"""Scripts that measure what the documentation reports, one room for each subject.

Run them from the repository's root as `python -m benchmarks.ROOM.SCRIPT`; nothing in the packages imports them.
"""

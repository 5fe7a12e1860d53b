"""Claims about repeated pushes: convergent, divergent, multi-modal.

Sections of the report: `kinds_of_push` and `modality`.
"""

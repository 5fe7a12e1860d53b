"""Claims about repeated pushes: convergent, divergent, multi-modal.

Import `kinds_of_push` and `modality`.
"""

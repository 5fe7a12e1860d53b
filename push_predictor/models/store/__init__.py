"""Model files: how models are saved, loaded and found by name.

Import `model_file` and `model_registry`; the `*_record` modules define the parts of a file.
"""

"""Model files: how models are saved, loaded and held by name.

Import `model_file` and `model_registry`; the `*_record` modules define the parts of a file.
"""

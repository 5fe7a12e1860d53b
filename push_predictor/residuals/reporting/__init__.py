"""What a person or a program reads of a trace: page, tables, sentences, JSON.

Import `page`, `summary` and `trace_json`.
"""

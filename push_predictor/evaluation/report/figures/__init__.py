"""The figures of a validation report, one module each. `gallery` draws them all, with captions."""

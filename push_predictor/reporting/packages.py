"""The packages that report pages need; they are optional."""

from __future__ import annotations

from importlib import import_module

from push_predictor.errors import PushPredictorError

PACKAGES = ("matplotlib", "jinja2")


def check_report_packages(option: str) -> None:
    """Raise PushPredictorError that names the option unless a page with pictures can be made.

    Called before the work, so that minutes of it are not lost at the end.
    """
    for name in PACKAGES:
        try:
            import_module(name)
        except ImportError as error:
            raise PushPredictorError(
                f"{option}: a report needs {name} ({error}); pip install 'push_predictor[report]'"
            ) from None

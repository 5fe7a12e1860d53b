"""Linear algebra of small matrices on one thread: more threads cost twelve times the CPU time and save none."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread, whatever the environment asks for."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield

"""How many threads linear algebra may use."""

from __future__ import annotations

from threadpoolctl import threadpool_limits

one_thread = threadpool_limits.wrap(
    limits=1, user_api="blas"
)  # matrices of 200 rows: more threads only wait for each other

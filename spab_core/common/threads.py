"""How many threads linear algebra may use."""

from __future__ import annotations

from threadpoolctl import threadpool_limits

# for matrices of 200 rows: more threads would only wait for each other
one_thread = threadpool_limits.wrap(limits=1, user_api="blas")

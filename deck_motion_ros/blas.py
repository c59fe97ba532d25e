"""Linear algebra on one thread: for matrices as small as ours more threads only cost."""

import os

VARIABLES = ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS')


def use_one_thread() -> None:
    """Ask for it, unless the environment says otherwise; before numpy is first imported."""
    for name in VARIABLES:
        os.environ.setdefault(name, '1')

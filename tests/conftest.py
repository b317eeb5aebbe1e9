"""What every test shares: one thread for linear algebra, and property-based tests that repeat."""

import os

# Before numpy loads its BLAS: the suite is made of small problems, and threads only get in each other's way.
for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
# Tests take more workers than a small machine has processors.
os.environ.setdefault("MCDEM_MOST_WORKERS", "8")

import hypothesis  # noqa: E402
import matplotlib  # noqa: E402

matplotlib.use("Agg")
hypothesis.settings.register_profile("repeatable", deadline=None, derandomize=True, print_blob=True)
hypothesis.settings.load_profile("repeatable")

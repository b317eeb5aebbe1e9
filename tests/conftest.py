"""What every test shares: one thread for linear algebra, and property-based tests that repeat."""

import os

# Before numpy loads its BLAS: the suite is made of small problems, and threads only get in each other's way.
for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
# Tests take more workers than a small machine has processors.
os.environ.setdefault("MCDEM_MOST_WORKERS", "8")

import hypothesis  # noqa: E402
import matplotlib  # noqa: E402
import pytest  # noqa: E402

matplotlib.use("Agg")
hypothesis.settings.register_profile("repeatable", deadline=None, derandomize=True, print_blob=True)
hypothesis.settings.load_profile("repeatable")

LONGEST = (
    "test_validation",
    "test_compilation",
    "test_endings",
    "test_event_selection",
    "test_cli",
    "test_runs",
    "test_moments",
    "test_report",
    "test_matrix_free",
    "test_arguments",
    "test_two_sizes",
)
"""Files with the longest tests: begun last, one of them would keep one worker busy alone at the end."""


def _file_of(nodeid):
    return nodeid.partition("::")[0].rpartition("/")[2].removesuffix(".py")


def pytest_collection_modifyitems(items):
    """The longest files first, the others as they come."""
    place = {name: k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(_file_of(item.nodeid), len(LONGEST)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Under `--dist loadfile`: files in the order above, not in that of their numbers of tests."""
    if config.getoption("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    config.option.loadscopereorder = False
    return LoadFileScheduling(config, log)

"""On what kind of machine numbers were made: the course of an aggregate is chaotic, so round-off decides it in the end."""

from __future__ import annotations

from functools import cache
from importlib.metadata import version

import llvmlite.binding
import threadpoolctl


@cache
def machine() -> str:
    """Processor for which code is compiled, kernel of the linear algebra, and versions: where these agree, runs do bit by bit."""
    import scipy.linalg  # noqa: F401  loads the linear algebra that compiled code calls

    kernels = sorted(
        {
            f"{info['internal_api']} {info.get('version', '')} {info.get('architecture', '')}".strip()
            for info in threadpoolctl.threadpool_info()
            if info["user_api"] == "blas"
        }
    )
    libraries = [f"{name} {version(name)}" for name in ("numba", "llvmlite", "numpy", "scipy")]
    return ", ".join([llvmlite.binding.get_host_cpu_name(), *kernels, *libraries])

"""On what kind of machine numbers were made: the course of an aggregate is chaotic, so round-off decides it in the end.

Two machines whose `machine()` agrees compute the same encounter bit for bit.  Other linear algebra, another width of vectors,
fused multiplications or another mathematical library round differently: a large aggregate then takes another course, and may
come to another outcome, of the same distribution.
"""

from __future__ import annotations

import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version

import llvmlite.binding
import threadpoolctl

ARITHMETIC = ("fma", "avx", "avx2", "avx512f", "neon", "sve")
"""Instructions of a processor that change how sums and products are rounded, or in which order they are made."""
NOT_KNOWN = "a machine that was not written down"
"""Of encounters in datasets that do not say."""


@cache
def machine() -> str:
    """The kind of this machine, a list in one line.

    Processor as the compiler knows it, with the instructions that matter to rounding; for what numba compiles, where that is
    not this processor; kernels of the linear algebra; mathematical library; versions of what compiles and computes.
    """
    import numba
    import scipy.linalg  # noqa: F401  loads the linear algebra that compiled code calls

    kernels = sorted(
        {
            f"{info['internal_api']} {info.get('version', '')} {info.get('architecture', '')}".strip()
            for info in threadpoolctl.threadpool_info()
            if info["user_api"] == "blas"
        }
    )
    has = llvmlite.binding.get_host_cpu_features()
    instructions = [name for name in ARITHMETIC if has.get(name)]
    processor = " ".join([platform.machine(), llvmlite.binding.get_host_cpu_name(), *instructions])
    told = (numba.config.CPU_NAME, numba.config.CPU_FEATURES)
    target = [f"numba target {' '.join(filter(None, told))}"] if any(told) else []
    mathematics = " ".join(platform.libc_ver()).strip() or platform.system()
    libraries = [f"{name} {version(name)}" for name in ("numba", "llvmlite", "numpy", "scipy")]
    return ", ".join([processor, *target, *kernels, mathematics, *libraries])


def differing(one: str, other: str) -> tuple[str, str]:
    """What each of two kinds of machine has that the other has not."""
    a, b = one.split(", "), other.split(", ")
    return ", ".join(part for part in a if part not in b), ", ".join(part for part in b if part not in a)


class Machines:
    """How many encounters each kind of machine computed; as text, the attribute `machines` of a dataset."""

    _WORDS = " encounters on "

    def __init__(self, counts: Mapping[str, int] | None = None) -> None:
        self.counts = dict(counts or {})

    @classmethod
    def read(cls, text: str | None, encounters: int) -> Machines:
        """Those that a dataset of so many encounters names; text None where it names none."""
        if text is None:
            return cls({NOT_KNOWN: encounters} if encounters else {})
        rows = [line.partition(cls._WORDS) for line in text.splitlines()]
        return cls({kind: int(count) for count, _, kind in rows})

    def __str__(self) -> str:
        return "\n".join(f"{count}{self._WORDS}{kind}" for kind, count in self.counts.items())

    def computed(self, kind: str) -> str:
        """Count an encounter; in words what it means, where it is the first of its kind and others came before."""
        others = [known for known in self.counts if known not in (kind, NOT_KNOWN)]
        first = kind not in self.counts
        self.counts[kind] = self.counts.get(kind, 0) + 1
        if not first or not others:
            return ""
        here, before = differing(kind, others[-1])
        return (
            f"encounters were computed with {before}, and are now computed with {here} too: as good a sample of the process, "
            "but no machine alone gives these bits; the dataset's attribute machines counts the encounters of each kind"
        )

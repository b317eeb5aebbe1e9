"""What pbekit says when it refuses or doubts."""

from __future__ import annotations


class PBEError(ValueError):
    """A balance that cannot be built or solved as asked; the message names the place and the cure.

    Examples
    --------
    >>> import pbekit
    >>> try:
    ...     pbekit.Grid.primaries(exact_to=32, largest=20)
    ... except pbekit.PBEError as error:
    ...     print(str(error).partition(",")[0])
    grid: largest = 20 lies below exact_to = 32
    """


class KernelError(PBEError):
    """A rate that is negative, not finite, not symmetric, or fragments that do not conserve mass.

    Examples
    --------
    >>> import pbekit
    >>> grid = pbekit.Grid.primaries(exact_to=3)
    >>> try:
    ...     pbekit.PopulationBalance(grid, pbekit.Aggregation(lambda m, n: 1e-18 * (m + 0 * n)))
    ... except pbekit.KernelError as error:
    ...     print(error)
    kernel <lambda>: not symmetric (the other way round 2e-18) for masses 1 and 2 (cells 0, 1): 1e-18
    """


class RangeWarning(UserWarning):
    """A law is used outside the range in which its source says it holds.

    Examples
    --------
    >>> import warnings
    >>> from pbekit import RangeWarning
    >>> from pbekit.balance import CriticalSize
    >>> with warnings.catch_warnings(record=True, action="always") as said:
    ...     law = CriticalSize(stress=500.0, reference_stress=1000.0, reference_size=24.0, q=4.0)
    >>> said[0].category is RangeWarning
    True
    """

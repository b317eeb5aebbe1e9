"""What pbekit says when it refuses or doubts."""

from __future__ import annotations


class PBEError(ValueError):
    """A balance that cannot be built or solved as asked; the message names the place and the cure."""


class KernelError(PBEError):
    """A rate that is negative, not finite, not symmetric, or fragments that do not conserve mass."""


class RangeWarning(UserWarning):
    """A law is used outside the range in which its source says it holds."""

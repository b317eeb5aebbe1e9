"""Shear aggregation and breakup of colloids: Monte Carlo over encounters resolved by Stokesian dynamics."""

from __future__ import annotations

from pathlib import Path

from mcdem import compiled_cache

# Before the first kernel is decorated.
compiled_cache.key_by_sources(Path(__file__).parent)

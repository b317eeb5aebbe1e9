"""Hydrodynamic interaction between spheres; choose one level.

free_draining, rotne_prager, fts, stokesian    the levels, one a file; a new one is a file and a line in `MENU` (`level`)
resistance           what they fill, and spheres that turn freely
grand_mobility       far field of forces, torques and stresslets
two_sphere/          the exact two-sphere problem, and the lubrication made of it
frozen_far_field     the far field of a while ago, turned along and corrected
velocities           velocities of free spheres;  matrix_free: the same for many, by iteration in O(N) memory
mobility_product     the grand mobility applied pair by pair, for both of these
undisturbed_flow     the linear flow that they are in
"""

from __future__ import annotations

from importlib import import_module

from mcdem.hydrodynamics.level import Level, know

__all__ = ["LEVELS", "Level"]

MENU = ("free_draining", "rotne_prager", "fts", "stokesian")

LEVELS: dict[str, Level] = {name: import_module(f"mcdem.hydrodynamics.{name}").LEVEL for name in MENU}
for _level in LEVELS.values():
    know(_level)

"""Shear aggregation and breakup of colloids: Monte Carlo over encounters resolved by Stokesian dynamics.

    scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    result = mcdem.simulate_encounter(scene, aggregate_i, aggregate_j, seed=1)

Names are imported when they are first used, so that a command that needs no compiled code does not wait for it.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from mcdem import compiled_cache

if TYPE_CHECKING:
    from mcdem.aggregates.aggregate import Aggregate as Aggregate
    from mcdem.encounter.capture_efficiency import PairEfficiency as PairEfficiency
    from mcdem.encounter.capture_efficiency import critical_offset as critical_offset
    from mcdem.encounter.capture_efficiency import pair_efficiency as pair_efficiency
    from mcdem.encounter.simulate import EncounterResult as EncounterResult
    from mcdem.encounter.simulate import Recorder as Recorder
    from mcdem.encounter.simulate import simulate_encounter as simulate_encounter
    from mcdem.errors import UserError as UserError
    from mcdem.free_spheres import Velocities as Velocities
    from mcdem.free_spheres import velocities as velocities
    from mcdem.scene import Scene as Scene
    from mcdem.scene import load_scene as load_scene

# Before the first kernel is decorated.
compiled_cache.key_by_sources(Path(__file__).parent)

_HOME = {
    "Aggregate": "mcdem.aggregates.aggregate",
    "EncounterResult": "mcdem.encounter.simulate",
    "PairEfficiency": "mcdem.encounter.capture_efficiency",
    "Recorder": "mcdem.encounter.simulate",
    "Scene": "mcdem.scene",
    "UserError": "mcdem.errors",
    "Velocities": "mcdem.free_spheres",
    "critical_offset": "mcdem.encounter.capture_efficiency",
    "load_scene": "mcdem.scene",
    "pair_efficiency": "mcdem.encounter.capture_efficiency",
    "simulate_encounter": "mcdem.encounter.simulate",
    "velocities": "mcdem.free_spheres",
}

__all__ = [
    "Aggregate",
    "EncounterResult",
    "PairEfficiency",
    "Recorder",
    "Scene",
    "UserError",
    "Velocities",
    "critical_offset",
    "load_scene",
    "pair_efficiency",
    "simulate_encounter",
    "velocities",
]


if not TYPE_CHECKING:  # or a type checker would take every unknown name for an object

    def __getattr__(name: str) -> object:
        if name not in _HOME:
            raise AttributeError(f"module 'mcdem' has no attribute {name!r}")
        return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])

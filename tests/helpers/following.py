"""Primaries followed step by step without shortcuts, for tests of what acts on them."""

from __future__ import annotations

import numpy as np
from effects_family import scene

from mcdem.effects.twisting import TwistingKernel
from mcdem.encounter.simulate import options_of, physics_of
from mcdem.hydrodynamics.undisturbed_flow import UndisturbedFlow
from mcdem.integrators import state
from mcdem.integrators.pairs import find_gaps
from mcdem.integrators.scheme import scheme_of
from mcdem.integrators.time_loop import Bounds, follow_steps, new_watch


def free_draining(*names, **changes):
    """A scene of these effects without hydrodynamic interactions, small steps."""
    return scene(*names).with_changes(
        {"hydrodynamics.level": "free_draining", "numerics.implicit.max_step": 0.05} | changes
    )


def untwisted(physics):
    """Without resistance to twisting, in the compiled code of a scene that has it."""
    return physics._replace(
        resistances=tuple(
            law._replace(stiffness=0.0) if isinstance(law, TwistingKernel) else law
            for law in physics.resistances
        )
    )


class Follow:
    """Primaries of a scene in its flow, or in fluid at rest, step by step without shortcuts."""

    def __init__(self, scene_, positions, bonds, still=False, springs=None, without_twist=False):
        self.flow, self.physics = physics_of(scene_)
        if without_twist:
            self.physics = untwisted(self.physics)
        if still:
            self.flow = UndisturbedFlow(np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(5))
        self.options = options_of(scene_)
        n = len(positions)
        bonded = np.zeros((n, n), bool)
        for i, j in bonds:
            bonded[i, j] = bonded[j, i] = True
        self.motion = state.Motion(
            np.array(positions, float, order="C"),  # numba compiles anew for another layout
            np.zeros((n, 3)),
            bonded,
            np.full((n, n), -np.inf),
            np.ones(n),
            np.zeros(n, np.int64),
            np.zeros((n, n, 7)) if scene_.effects.resisting else None,
        )
        if springs is not None:
            self.motion.springs[:] = springs
        self.log, self.history = state.new_log(), state.new_history(self.motion)
        self.work = scheme_of(self.options).workspace(n, scene_.effects.resisting)
        self.gaps = np.empty((n, n))
        find_gaps(self.motion.positions, self.motion.radii, self.gaps)

    def until(self, time, steps=10**9):
        log = self.log
        code = follow_steps(
            state.Group(self.motion, self.history, self.gaps, self.work),
            self.flow,
            self.physics,
            self.options,
            log,
            new_watch(log, np.inf),
            Bounds(0.0, np.inf, np.inf, time, log.steps[0] + steps),
        )
        assert code in (state.DONE, state.TOO_MANY_STEPS)
        return self.motion.positions

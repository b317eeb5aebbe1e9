"""The course of an encounter that is known without one."""

from __future__ import annotations

import numpy as np

from mcdem.encounter.trajectory import Trajectory

A, RATE = 500e-9, 1e4


def turning_trimer(frames=9):
    """A doublet turning, a monomer drifting by that bonds halfway and is lost again."""
    t = np.arange(frames) * 2e-5
    angle = 0.5 * RATE * t
    spoke = A * np.stack([np.zeros_like(t), np.sin(angle), np.cos(angle)], axis=1)
    third = np.stack([np.zeros_like(t), 3 * A + 0 * t, (t - t[frames // 2]) * RATE * 3 * A], axis=1)
    positions = np.stack([spoke, -spoke, third], axis=1)
    tension = np.full((frames, 3, 3), np.nan)
    tension[:, 0, 1] = tension[:, 1, 0] = 1e-9 * np.sin(2 * angle)
    tension[frames // 2, 0, 2] = tension[frames // 2, 2, 0] = 5e-9
    return Trajectory(A, RATE, 1.107e-8, t, positions, tension, np.array([0, 0, 1]), {"outcome": "parted"})

"""Rigid parts: which primaries move together, and where they will be if they go on turning as they do.

A body is a connected component of the contact network.  Its motion over half a step is the rotation and the
translation of its best rigid fit plus what is left of the velocities, turned along.  A straight-line
extrapolation would stretch every bond of a turning cluster by r theta^2/8, several minimum approach distances
at a step of 0.1/g.
"""

from __future__ import annotations

import numpy as np
from numba import types

from mcdem.compilation import compiled, separately_compiled
from mcdem.integrators.rotations import rotation


@separately_compiled(types.int64)
def label_bodies(bonded, labels):
    """Number the connected components of the contact network (N, N) into labels (N,); returns their count."""
    n = labels.shape[0]
    stack = np.empty(n, np.int64)
    labels[:] = -1
    count = 0
    for seed in range(n):
        if labels[seed] >= 0:
            continue
        labels[seed] = count
        stack[0] = seed
        depth = 1
        while depth > 0:
            depth -= 1
            i = stack[depth]
            for j in range(n):
                if bonded[i, j] and labels[j] < 0:
                    labels[j] = count
                    stack[depth] = j
                    depth += 1
        count += 1
    return count


@compiled
def centre_and_reach(positions, radii, labels, body, centre):
    """Centre (3,) of one body; returns its outer radius."""
    members = 0
    centre[:] = 0.0
    for i in range(radii.shape[0]):
        if labels[i] == body:
            members += 1
            for k in range(3):
                centre[k] += positions[i, k]
    for k in range(3):
        centre[k] /= members
    reach = 0.0
    for i in range(radii.shape[0]):
        if labels[i] == body:
            r = 0.0
            for k in range(3):
                r += (positions[i, k] - centre[k]) ** 2
            reach = max(reach, np.sqrt(r) + radii[i])
    return reach


@compiled
def mean_velocity(velocities, labels, body, out):
    """Mean velocity (3,) of one body."""
    members = 0
    out[:] = 0.0
    for i in range(labels.shape[0]):
        if labels[i] == body:
            members += 1
            for k in range(3):
                out[k] += velocities[i, k]
    for k in range(3):
        out[k] /= members


@compiled
def rigid_fit(positions, velocities, labels, body, fit):
    """Centre, mean velocity and least-squares angular velocity of one body into fit (3, 3)."""
    fit[:] = 0.0
    members = 0
    for i in range(labels.shape[0]):
        if labels[i] == body:
            members += 1
            for k in range(3):
                fit[0, k] += positions[i, k]
                fit[1, k] += velocities[i, k]
    for k in range(3):
        fit[0, k] /= members
        fit[1, k] /= members
    if members == 1:
        return
    xx = yy = zz = xy = xz = yz = 0.0
    for i in range(labels.shape[0]):
        if labels[i] == body:
            x, y, z = positions[i, 0] - fit[0, 0], positions[i, 1] - fit[0, 1], positions[i, 2] - fit[0, 2]
            u, v, w = velocities[i, 0] - fit[1, 0], velocities[i, 1] - fit[1, 1], velocities[i, 2] - fit[1, 2]
            xx += x * x
            yy += y * y
            zz += z * z
            xy += x * y
            xz += x * z
            yz += y * z
            fit[2, 0] += y * w - z * v
            fit[2, 1] += z * u - x * w
            fit[2, 2] += x * v - y * u
    # A straight body has no moment about its own axis: the small addition leaves that spin at zero.
    ridge = 1e-9 * (xx + yy + zz)
    a, b, c = yy + zz + ridge, xx + zz + ridge, xx + yy + ridge
    # Symmetric 3 x 3 solve by cofactors; off-diagonals of the inertia are -xy, -xz, -yz.
    c00, c01, c02 = b * c - yz * yz, xy * c + xz * yz, xy * yz + xz * b
    c11, c12, c22 = a * c - xz * xz, a * yz + xy * xz, a * b - xy * xy
    determinant = a * c00 - xy * c01 - xz * c02
    p, q, r = fit[2, 0], fit[2, 1], fit[2, 2]
    fit[2, 0] = (c00 * p + c01 * q + c02 * r) / determinant
    fit[2, 1] = (c01 * p + c11 * q + c12 * r) / determinant
    fit[2, 2] = (c02 * p + c12 * q + c22 * r) / determinant


@compiled
def share_beyond(history, interval):
    """Time from the middle of the last step to that of the coming one, over that between the last two; 0 without an older one.

    interval : length of the coming step
    """
    if history.steps[1] == 0.0:
        return 0.0
    return (history.steps[0] + interval) / (history.steps[0] + history.steps[1])


@separately_compiled()
def extrapolate(positions, history, labels, bodies, interval, out):
    """Positions (N, 3) after `interval`, every body turning as a whole.

    The rigid motion of a body and what is not rigid in its velocities are carried on from the last two steps
    (`History`): linearly in time, the non-rigid part turning with the body.  Then the midpoint of a step is off
    by the third power of the step; lubrication multiplies a wrong direction of a bond by fifty.
    """
    last, older = np.empty((3, 3)), np.empty((3, 3))
    turn, carry, carry_older = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    lag = 0.5 * history.steps[0]
    spacing = 0.5 * (history.steps[0] + history.steps[1])
    share = share_beyond(history, interval)
    mean, spin = np.empty(3), np.empty(3)
    for body in range(bodies):
        rigid_fit(history.positions[0], history.velocities[0], labels, body, last)
        if share > 0.0:
            rigid_fit(history.positions[1], history.velocities[1], labels, body, older)
        else:
            older[:] = last
        for k in range(3):
            mean[k] = last[1, k] + share * (last[1, k] - older[1, k])
            spin[k] = last[2, k] + share * (last[2, k] - older[2, k])
        rotation(spin * interval, turn)
        rotation(spin * (lag + 0.5 * interval), carry)
        rotation(spin * (lag + 0.5 * interval + spacing), carry_older)
        centre = np.zeros(3)
        members = 0
        for i in range(labels.shape[0]):
            if labels[i] == body:
                members += 1
                for k in range(3):
                    centre[k] += positions[i, k]
        for k in range(3):
            centre[k] /= members
        for i in range(labels.shape[0]):
            if labels[i] != body:
                continue
            x, y, z = positions[i, 0] - centre[0], positions[i, 1] - centre[1], positions[i, 2] - centre[2]
            u, v, w = residual_velocity(history.positions[0], history.velocities[0], i, last)
            a, b, c = u, v, w
            if share > 0.0:
                a, b, c = residual_velocity(history.positions[1], history.velocities[1], i, older)
            for k in range(3):
                now = carry[k, 0] * u + carry[k, 1] * v + carry[k, 2] * w
                before = carry_older[k, 0] * a + carry_older[k, 1] * b + carry_older[k, 2] * c
                if share == 0.0:
                    before = now
                out[i, k] = (
                    centre[k]
                    + turn[k, 0] * x
                    + turn[k, 1] * y
                    + turn[k, 2] * z
                    + interval * (mean[k] + now + share * (now - before))
                )


@compiled
def residual_velocity(positions, velocities, i, fit):
    """Velocity of primary i less the rigid motion of its body."""
    x, y, z = positions[i, 0] - fit[0, 0], positions[i, 1] - fit[0, 1], positions[i, 2] - fit[0, 2]
    return (
        velocities[i, 0] - fit[1, 0] - (fit[2, 1] * z - fit[2, 2] * y),
        velocities[i, 1] - fit[1, 1] - (fit[2, 2] * x - fit[2, 0] * z),
        velocities[i, 2] - fit[1, 2] - (fit[2, 0] * y - fit[2, 1] * x),
    )

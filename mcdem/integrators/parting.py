"""Whether two bodies that recede from each other are surely apart for good.

In simple shear a distance says nothing: two spheres on a closed orbit recede to any distance and come back (Batchelor & Green
1972, section 5).  What says it is where they are going.  In a flow u = G r with the strain E the separation r of two free
spheres of radii a and b moves by

    dr/dt = u - B E.r - (A - B) n (n.E.n) r,   so that   r dr/dt = (1 - A) q,   q = r.E.r,
    dq/dt = p - 2 B |E.r|^2 - 2 (A - B) q^2/r^2,   p = |G r|^2 + r.G.G.r,
    A = (5/2) (a^3 + b^3)/r^3,   B = (a^5 + b^5 + (5/3) a^2 b^2 (a + b))/r^5   far apart.

In every flow that a scene may have p is nowhere negative (`linear_flows`), and they recede as long as q is positive.  With q > 0
and p above what the spheres take from dq/dt, q grows; and as r grows, what they take falls as r^-3, while p stays (y^2 in
simple shear) or grows (where the flow stretches).  So they never turn back.  In simple shear that is y^2 > 2 B |E.r|^2: three
halves of the limiting y^2 = (4/3) B |E.r|^2, so a fifth more of y than that of the outermost closed orbit.

A body that is no sphere disturbs the flow less than the sphere about it does, whose radius, the outer one, stands for a and b.
Forces that act at a distance end at `FORCE_RANGE`, and bodies within it of each other are not apart.

What goes on alone keeps the streamline that it is on, and strays from its path by what the other would still have made of it.
This stray is, to first order,

    (A/3) |r x u|/|u| + (B/3) |E.r x u|/|u| r^2/q,

in simple shear (A/3) sqrt(x^2 + y^2) + B z^2/(6 y), and is bounded too.
"""

from __future__ import annotations

import numpy as np
from numba import types

from mcdem.compilation import compiled, separately_compiled
from mcdem.integrators.bodies import centre_and_reach, mean_velocity
from mcdem.integrators.pairs import FORCE_RANGE

STRAY = 0.01
"""Largest stray of what goes on alone, in outer radii of the larger body."""


@compiled
def across(first, second):
    """|first x second| of two vectors (3,)."""
    a = first[1] * second[2] - first[2] * second[1]
    b = first[2] * second[0] - first[0] * second[2]
    c = first[0] * second[1] - first[1] * second[0]
    return np.sqrt(a * a + b * b + c * c)


@separately_compiled(types.boolean)
def surely_apart(separation, velocity, gradient, reach_a, reach_b, factor):
    """Whether two bodies at `separation` (3,), which changes by `velocity` (3,), are further than `factor` (R_a + R_b) apart and
    never turn back.

    gradient : (3, 3) of the undisturbed flow;  reach_a, reach_b : outer radii
    """
    carried, strained = np.zeros(3), np.zeros(3)
    squares = receding = 0.0
    for k in range(3):
        squares += separation[k] * separation[k]
        receding += separation[k] * velocity[k]
        for m in range(3):
            carried[k] += gradient[k, m] * separation[m]
            strained[k] += 0.5 * (gradient[k, m] + gradient[m, k]) * separation[m]
    nearest = max(factor * (reach_a + reach_b), reach_a + reach_b + FORCE_RANGE)
    if squares < nearest * nearest or receding <= 0.0:
        return False
    q = p = stretched = speed = 0.0
    for k in range(3):
        q += separation[k] * strained[k]
        stretched += strained[k] * strained[k]
        speed += carried[k] * carried[k]
        for m in range(3):
            p += separation[k] * gradient[k, m] * carried[m]
    p += speed
    if q <= 0.0 or speed == 0.0:
        return False
    distance = np.sqrt(squares)
    speed = np.sqrt(speed)
    a2, b2 = reach_a * reach_a, reach_b * reach_b
    a = 2.5 * (a2 * reach_a + b2 * reach_b) / (squares * distance)
    b = a2 * a2 * reach_a + b2 * b2 * reach_b + 5.0 / 3.0 * a2 * b2 * (reach_a + reach_b)
    b /= squares * squares * distance
    if p <= 2.0 * b * stretched + 2.0 * a * q * q / squares:
        return False
    stray = (a * across(separation, carried) + b * across(strained, carried) * squares / q) / (3.0 * speed)
    return stray < STRAY * max(reach_a, reach_b)


@separately_compiled(types.int64)
def label_groups(motion, labels, bodies, gradient, factor, groups):
    """Number the groups of bodies of which any two are surely apart, into `groups` (N,) by primary; returns their count.

    labels (N,) : body of each primary
    """
    group = np.arange(bodies)
    first, second, v1, v2 = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    count = bodies
    for a in range(bodies):
        reach_a = centre_and_reach(motion.positions, motion.radii, labels, a, first)
        mean_velocity(motion.velocities, labels, a, v1)
        for b in range(a):
            if group[a] == group[b]:
                continue
            reach_b = centre_and_reach(motion.positions, motion.radii, labels, b, second)
            mean_velocity(motion.velocities, labels, b, v2)
            if not surely_apart(first - second, v1 - v2, gradient, reach_a, reach_b, factor):
                gone, kept = max(group[a], group[b]), min(group[a], group[b])
                count -= 1
                for c in range(bodies):
                    if group[c] == gone:
                        group[c] = kept
                    elif group[c] > gone:
                        group[c] -= 1
    for i in range(labels.shape[0]):
        groups[i] = group[labels[i]]
    return count

"""The undisturbed flow u_inf = G r of the compiled code, in reduced units."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from mcdem.compilation import compiled


class UndisturbedFlow(NamedTuple):
    """A steady linear flow."""

    gradient: np.ndarray  # (3, 3) G
    strain: np.ndarray  # (3, 3) its symmetric part
    strain_five: np.ndarray  # (5,) the same in the basis of `grand_mobility`
    # Whether what moves together is seen from its mean: where the flow stretches, it would be carried away exponentially.
    centred: Literal[True] | None = None


@compiled
def flow_component(gradient, positions, i, k):
    """Component k of the undisturbed velocity at sphere i of positions (N, 3)."""
    return (
        gradient[k, 0] * positions[i, 0] + gradient[k, 1] * positions[i, 1] + gradient[k, 2] * positions[i, 2]
    )


@compiled
def spin_component(gradient, k):
    """Component k of the angular velocity of the undisturbed flow, half its vorticity."""
    a, b = (k + 1) % 3, (k + 2) % 3
    return 0.5 * (gradient[b, a] - gradient[a, b])


@compiled
def velocities_of_flow(flow, positions, out):
    """Undisturbed velocities into out (3N,), relative to their mean where the flow is seen from it."""
    n = positions.shape[0]
    for i in range(n):
        for k in range(3):
            out[3 * i + k] = flow_component(flow.gradient, positions, i, k)
    stay_at_mean(out, flow.centred)


@compiled
def stay_at_mean(velocities, centred):
    """Take their mean from the undisturbed velocities (3N,) where the (linear) flow is seen from the spheres' mean."""
    if centred is not None:
        n = velocities.shape[0] // 3
        for k in range(3):
            mean = 0.0
            for i in range(n):
                mean += velocities[3 * i + k]
            for i in range(n):
                velocities[3 * i + k] -= mean / n

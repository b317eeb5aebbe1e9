"""Steps of one group of primaries, until something calls for a decision.

This is the whole compiled loop of an encounter: everything that it runs through is laid into this one function, so
that it is compiled once.  What to do when bodies have parted or have come to rest in themselves is decided in
`integrate`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types

from mcdem.compilation import compiled, separately_compiled
from mcdem.integrators.bodies import label_bodies
from mcdem.integrators.parting import label_groups
from mcdem.integrators.scheme import advance
from mcdem.integrators.state import DONE, LOOSE, PARTED, PAUSED, SETTLED, TOO_MANY_STEPS, Log

# Strain between two looks at which bodies there are and whether they part.
LOOK_EVERY = 0.5


class Watch(NamedTuple):
    """What `follow_steps` keeps in mind from one call to the next; one-element arrays, times in 1/g."""

    look: np.ndarray  # when to look at the bodies again
    noted: np.ndarray  # last change of contacts that was noticed, nan if none
    quiet_since: np.ndarray  # when the contacts of this group last changed


def new_watch(log: Log, quiet_since: float) -> Watch:
    """Watch over a group whose contacts last changed at `quiet_since`."""
    return Watch(log.time.copy(), log.last_bond_change.copy(), np.array([quiet_since]))


class Bounds(NamedTuple):
    """When the steps of a group end; times in 1/g."""

    separation: float  # centre distance in R_i + R_j beyond which bodies that never turn back have PARTED (`parting`); 0: never
    quiet_time: float  # strain without a change of contacts after which a single body has SETTLED; inf: never
    pause: float  # time from which on the next step returns PAUSED
    end: float  # time at which all is DONE
    most_steps: int  # number of steps after which it is TOO_MANY_STEPS
    loose: float = (
        np.inf
    )  # gap between two bodies beyond which, quiet for as long, they are LOOSE; inf: never


@compiled
def gap_between(gaps, labels):
    """Smallest gap between primaries of different bodies."""
    smallest = np.inf
    for i in range(labels.shape[0]):
        for j in range(i):
            if labels[i] != labels[j]:
                smallest = min(smallest, gaps[i, j])
    return smallest


@separately_compiled(types.int64)
def follow_steps(group, flow, physics, options, log, watch, bounds):
    """Follow some primaries together by the steps of a scheme; log.time is their time.

    Returns one of the codes that `Bounds` names, or that of a failed step (`state`).
    """
    part, work = group.motion, group.work
    while log.time[0] < bounds.end - 1e-12:
        change = log.last_bond_change[0]
        if not np.isnan(change) and change != watch.noted[0]:
            watch.noted[0] = change
            watch.quiet_since[0] = change
        if log.time[0] >= watch.look[0]:
            watch.look[0] = log.time[0] + LOOK_EVERY
            bodies = label_bodies(part.bonded, work.labels)
            quiet = log.time[0] >= watch.quiet_since[0] + bounds.quiet_time - 1e-9
            if bodies > 1:
                if bounds.separation > 0.0:
                    groups = np.empty(work.labels.shape[0], np.int64)
                    if label_groups(part, work.labels, bodies, flow.gradient, bounds.separation, groups) > 1:
                        return PARTED
                if bodies == 2 and quiet and gap_between(group.gaps, work.labels) > bounds.loose:
                    return LOOSE
            elif quiet:
                return SETTLED
        if log.steps[0] >= bounds.most_steps:
            return TOO_MANY_STEPS
        code = advance(group, flow, physics, options, log, bounds.end)
        if code != DONE:
            return code
        if log.time[0] >= bounds.pause:
            return PAUSED
    return DONE

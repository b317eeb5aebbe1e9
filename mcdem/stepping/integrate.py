"""From the start of an encounter to its end: one loop, whichever scheme advances it."""

from __future__ import annotations

import numpy as np
from numba import njit

from mcdem.stepping.contacts import tensions
from mcdem.stepping.implicit import advance, find_gaps, scratch
from mcdem.stepping.paper_euler import advance_paper
from mcdem.stepping.state import DONE, TOO_MANY_STEPS, new_history


@njit(cache=True)
def record_frame(motion, physics, log, frames):
    """Write the state to the next free frame, if its time has come."""
    count = frames.written[0]
    if count >= frames.time.shape[0]:
        return
    if count > 0 and log.time[0] < frames.time[count - 1] + frames.interval:
        return
    frames.time[count] = log.time[0]
    frames.positions[count] = motion.positions
    tensions(motion.positions, motion.bonded, motion.radii, physics.jkr, physics.dmt, frames.tension[count])
    frames.written[0] = count + 1


@njit(cache=True)
def integrate(motion, flow, physics, implicit, paper, log, frames, end_time, max_steps):
    """Advance `motion` to `end_time`; exactly one of `implicit` and `paper` is given.  Returns a code of `state`."""
    n = motion.radii.shape[0]
    work = scratch(n)
    history = new_history(motion)
    gaps = np.empty((n, n))
    find_gaps(motion.positions, motion.radii, gaps)
    if frames is not None:
        record_frame(motion, physics, log, frames)
    while log.time[0] < end_time - 1e-12:
        if log.steps[0] >= max_steps:
            return TOO_MANY_STEPS
        if implicit is not None:
            code = advance(motion, history, flow, physics, implicit, log, gaps, work, end_time)
            if code != DONE:
                return code
        if paper is not None:
            code = advance_paper(motion, flow, physics, paper, log, gaps, work, end_time)
            if code != DONE:
                return code
        if frames is not None:
            record_frame(motion, physics, log, frames)
    return DONE

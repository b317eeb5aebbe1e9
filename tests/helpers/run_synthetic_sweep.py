"""A sweep of synthetic encounters in a process of its own, to be interrupted."""

from __future__ import annotations

import signal
import sys

import synthetic

from mcdem.monte_carlo import executors
from mcdem.monte_carlo.sweep import sweep

if __name__ == "__main__":
    # What a shell starts in the background is deaf to Ctrl-C, and so would be all that it starts.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    folder, workers, encounter = sys.argv[1:]
    with executors.opened("process", int(workers), apart=True) as crew:
        found = sweep(
            synthetic.scene(**synthetic.SMALL),
            folder,
            {"flow.viscosity": ["75 mPa s", "100 mPa s"]},
            replicas=2,
            events=400,
            executor=crew.executor,
            encounter=getattr(synthetic, encounter),
        )
    print(*[member.state for member in found])

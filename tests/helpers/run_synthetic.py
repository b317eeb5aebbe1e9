"""A run of synthetic encounters in a process of its own: to be killed, or to be many under mpiexec."""

from __future__ import annotations

import argparse
import os
import signal
import sys

import synthetic

from mcdem.monte_carlo import executors, run_control

if __name__ == "__main__":
    # What a shell starts in the background is deaf to Ctrl-C, and so would be all that it starts.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    parser = argparse.ArgumentParser()
    parser.add_argument("file")
    parser.add_argument("--events", type=int)
    parser.add_argument("--executor", default="process")
    parser.add_argument("--workers", type=int)
    parser.add_argument("--encounter", default="aggregation_and_breakup")
    given = parser.parse_args()
    # Write often: there is little time between a start and a kill.
    run_control.SHARE_OF_WRITING = 0.5
    with executors.opened(given.executor, given.workers) as crew:
        summary = run_control.run(
            synthetic.scene(**synthetic.SMALL),
            given.file,
            events=given.events,
            executor=crew.executor,
            workers=crew.workers,
            resume=True,
            encounter=getattr(synthetic, given.encounter),
            checkpoint_every=0.05,
        )
    print(summary.ended_by, summary.events, os.getpid())
    sys.exit(0)

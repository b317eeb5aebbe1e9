"""A command of mcdem, pbekit or validation in a process of its own, on encounters that only wait, to be interrupted.

python interrupted_program.py MARKER PROGRAM ARGUMENTS...: MARKER is made when the work that is to be cut off has begun.
"""

from __future__ import annotations

import itertools
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path

import toy_encounters

marker, program, *arguments = sys.argv[1:]
BEGUN = {"cost": 900}
"""Encounters after which a command is at what it is for."""
calls = itertools.count()


def waiting(*given, **options):
    number = next(calls)
    if number >= BEGUN.get(arguments[0], 5):
        Path(marker).touch()
        time.sleep(0.02)
    options.pop("record", None)
    options.pop("orient", None)
    return replace(toy_encounters.toy_encounter(*given, **options), cpu_time=1e-3)


# What a shell starts in the background is deaf to Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.argv = [program, *arguments]
if program == "mcdem":
    import mcdem.encounter.simulate

    mcdem.encounter.simulate.simulate_encounter = waiting
    from mcdem.__main__ import main
elif program == "pbekit":
    from pbekit.study import uncertainty

    draws_of = uncertainty.draws_of

    def said(estimated, output, draws, seed, progress, scheme):
        begun = lambda k: (Path(marker).touch(), progress(k))
        return draws_of(estimated, output, draws, seed, begun, scheme)

    uncertainty.draws_of = said
    from pbekit.__main__ import main
else:
    import validation.run

    def run(*_, **__):
        Path(marker).touch()
        time.sleep(60.0)

    validation.run.run = run
    from validation.__main__ import main
if __name__ == "__main__":
    main()

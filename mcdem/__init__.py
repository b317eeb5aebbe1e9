"""Shear aggregation and breakup of colloids: Monte Carlo over encounters resolved by Stokesian dynamics.

    scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    mcdem.run(scene, "run.nc", until="10 s")
    run = mcdem.open_run("run.nc")

Names are imported when they are first used, so that a command that needs no compiled code does not wait for it.
"""

from pathlib import Path

import lazy_loader as lazy

from mcdem import compiled_cache
from pbekit.version import __version__ as __version__

# Before the first kernel is decorated.
compiled_cache.key_by_sources(Path(__file__).parent)

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)

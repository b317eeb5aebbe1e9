"""DustPy: arrays of the collision kernel and of the probabilities to stick and to fragment, per pair."""

from __future__ import annotations

from pbekit.export.arrays import arrays_of, packed
from pbekit.export.target import MARK, HandOver, Target

MODULE = f'''"""{MARK}: collision kernel, sticking and fragmentation probabilities of a table for DustPy.

    from kernels_dustpy import attach
    sim.initialize()
    attach(sim, primary_mass)          # [g] of one primary; before sim.update()

DustPy's fields are (Nr, Nm, Nm) in CGS units: `dust.kernel`, `dust.p.stick`, `dust.p.frag`.  In its tests of
coagulation a kernel in cm^3/s with Sigma as mass per volume makes a box; so it is here.  Masses of the grid are
looked up in the table by their number of primaries, in the logarithm of both; beyond its classes a ValueError
says so.
"""

from pathlib import Path

import numpy as np
from scipy.interpolate import RegularGridInterpolator

DATA = np.load(Path(__file__).with_name("kernels.npz"))
SIZES = DATA["P"]


def on_sizes(name, sizes):
    """(N, N) values of K, B or f [m^3/s] between numbers of primaries."""
    sizes = np.asarray(sizes, float)
    if sizes.min() < SIZES[0] * (1 - 1e-6) or sizes.max() > SIZES[-1] * (1 + 1e-6):
        asked, known = f"{{sizes.min():.3g}} to {{sizes.max():.3g}}", f"{{SIZES[0]:g}} to {{SIZES[-1]:g}}"
        raise ValueError(f"masses of {{asked}} primaries: the table has {{known}}")
    log = np.log(np.clip(sizes, SIZES[0], SIZES[-1]))
    values = RegularGridInterpolator((np.log(SIZES),) * 2, np.log(np.maximum(DATA[name], 1e-300)))
    return np.exp(values(tuple(np.meshgrid(log, log, indexing="ij"))))


def probabilities(masses, primary_mass):
    """Kernel of encounters [cm^3/s], and the probabilities to stick and to fragment, (Nm, Nm)."""
    sizes = np.asarray(masses) / primary_mass
    met = on_sizes("f", sizes)
    return 1e6 * met, on_sizes("K", sizes) / met, on_sizes("B", sizes) / met


def attach(sim, primary_mass):
    """Put the table into a DustPy simulation and keep DustPy from computing these fields anew."""
    kernel, stick, frag = probabilities(sim.grid.m, primary_mass)
    for field, value in ((sim.dust.kernel, kernel), (sim.dust.p.stick, stick), (sim.dust.p.frag, frag)):
        field[...] = value
        field.updater = None
    sim.dust.p.updater = None
'''


def files(given: HandOver) -> dict[str, str | bytes]:
    """The module and its arrays."""
    kept = {
        name: value
        for name, value in arrays_of(given).items()
        if name in ("P", "K", "B", "f", "a", "g", "n0")
    }
    return {"kernels_dustpy.py": MODULE, "kernels.npz": packed(kept)}


TARGET = Target(
    title="DustPy",
    files=files,
    notes={
        "kernels_dustpy.py": "attach(sim, primary_mass) sets dust.kernel, dust.p.stick and dust.p.frag; keep it beside "
        "kernels.npz",
        "kernels.npz": "its arrays: P, and f, K, B [m^3/s]",
    },
    cannot=(
        "Daughters by pair: DustPy has one power law of fragments and erosion below a mass ratio; the "
        "numbers of daughters.csv have no "
        "place in it.",
        "Exchange of primaries without new aggregates, which counts as fragmentation here.",
        "Shapes.",
    ),
    check="With dust.p.frag set to 0 a box must follow a balance of K alone, B = 0.",
)

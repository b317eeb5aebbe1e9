"""OpenQBMM (quadrature-based moments): populationBalanceProperties with fitted coefficients.

Documented forms: aggregation `hydrodynamic` K = Ca (d_1 + d_2)^3, breakup `powerLaw` S = Cb d^e above minAbscissa, daughters
`symmetricFragmentation`.  The abscissa d is the diameter of the sphere of the aggregate's solid volume, 2 a P^(1/3), whose third
moment is the conserved mass; for one constant efficiency of compact aggregates Ca = eta g/6.
"""

from __future__ import annotations

import numpy as np

from pbekit.export import first_order as fit
from pbekit.export.foam import file
from pbekit.export.target import MARK, HandOver, Target


def files(given: HandOver) -> dict[str, str | bytes]:
    """The dictionary."""
    given.needs_breakup("OpenQBMM")
    d = 2 * given.radius * np.cbrt(given.rates.pivots)
    form = (d[:, None] + d[None]) ** 3
    kernel = fit.aggregation_coefficient(given, form)
    breakage = fit.breakage_power(given, d / (2 * given.radius))
    e = breakage.values["e"]
    coefficient = breakage.values["C"] / (2 * given.radius) ** e
    first, law, parts = given.rates.first_order, given.laws.breakage, fit.parts_of(given)
    assert first is not None and law is not None
    smallest = 2 * given.radius * np.cbrt(law.validity["P"][0])
    rate = np.where(d >= smallest * (1 - 1e-9), breakage.values["C"] * (d / (2 * given.radius)) ** e, 0.0)
    comment = "\n".join(
        [
            f"{MARK}: aggregation and breakup for OpenQBMM (univariate), from {given.source}",
            "The abscissa is the diameter [m] of the sphere of an aggregate's solid volume, 2 a P^(1/3).",
            f"Ca stands for an efficiency of {6 * kernel.values['C'] / given.shear_rate:.3g} on these spheres (Ca "
            "= eta g/6); above 1 it says "
            "how much farther aggregates span.",
            f"Residual of K: {kernel.words}.",
            f"Residual of S: {breakage.words}. S is of first order, in {first.words} at phi = {first.volume_fraction:g}.",
            "Symmetric fragmentation: two halves; parts of the table's parents are of "
            f"beta({parts.coefficient('c'):.3g}, {parts.coefficient('c'):.3g}).",
            fit.what_it_gives(given, kernel.values["C"] * form, rate, 300.0),
        ]
    )
    entries = {
        "populationBalanceModel": "univariate",
        "univariateCoeffs": {
            "aggregation": "true",
            "breakup": "true",
            "growth": "false",
            "nucleation": "false",
            "aggregationKernel": {
                "aggregationKernel": "hydrodynamic",
                "Ca": f"Ca [0 0 -1 0 0 0 0] {kernel.values['C']:.10g}",
            },
            "breakupKernel": {
                "breakupKernel": "powerLaw",
                "Cb": f"Cb [0 0 -1 0 0 0 0] {coefficient:.10g}",
                "minAbscissa": float(smallest),
                "abscissaExponent": float(e),
                "daughterDistribution": {"daughterDistribution": "symmetricFragmentation"},
            },
        },
    }
    return {"populationBalanceProperties": file(comment, entries)}


TARGET = Target(
    title="OpenQBMM (quadrature-based moments)",
    files=files,
    notes={
        "populationBalanceProperties": "aggregation and breakup of univariateCoeffs, for constant/populationBalanceProperties"
    },
    cannot=(
        "Efficiencies by pair: the hydrodynamic kernel has one constant; K follows the table within the "
        "residual that the file states.",
        "Breakup by encounters: OpenQBMM knows breakup of first order alone. S is that of one population and "
        "volume fraction, and must "
        "be fitted anew for another.",
        "Tabulated daughters: its distributions are laws; daughter_moments.csv holds what a distribution of "
        "your own would return.",
        "Shapes.",
    ),
    check="Run one cell from the moments of free primaries at the stated volume fraction: M_0 falls until the "
    "mean size settles near "
    "the last number in the file's comment, which is what these forms give in classes; moments of few "
    "nodes may differ by some per cent.",
)

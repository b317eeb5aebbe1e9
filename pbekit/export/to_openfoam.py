"""OpenFOAM's population balance (multiphaseEuler): entries of coalescence, breakup, daughters and shape.

Documented forms, from the sources of versions 9 to 14:

    AdachiStuartFokkink   K = (4/3) (3 pi/10)^(1/2) (eps/nu)^(1/2) (d_i + d_j)^3, without an efficiency
    constant              K = rate
    fractal shape         d = d_p (P/alphaC)^(1/Df) for primaries with kappa = 6/d_p
    Kusters               S = (4 eps/(15 pi nu))^(1/2) exp(-B/(eps R_c)),  R_c = (d_p/2) ((d/d_p)^Df/kc)^(1/Df)
    Laakkonen             for C4 = 2 two daughters of density 30 x^2 (1 - x)^2 each
"""

from __future__ import annotations

import numpy as np

from pbekit.errors import PBEError
from pbekit.export import first_order as fit
from pbekit.export.foam import file
from pbekit.export.target import MARK, HandOver, Target

DENSITY = 1000.0
"""Of the medium, assumed [kg/m^3]: eps = nu g^2 is given for it, and B goes with eps."""
ADACHI = 4 / 3 * np.sqrt(0.3 * np.pi)
LAAKKONEN = 3.0
"""Concentration of the beta density that Laakkonen's daughters are for C4 = 2."""


def files(given: HandOver) -> dict[str, str | bytes]:
    """The dictionary entries."""
    given.needs_breakup("OpenFOAM")
    about, g, a = given.rates.table.about, given.shear_rate, given.radius
    if "viscosity" not in about:
        raise PBEError(
            f"{given.source}: the table does not say its viscosity, which OpenFOAM's dissipation follows from"
        )
    nu = float(about["viscosity"]) / DENSITY
    dissipation = nu * g**2
    p, shape = given.rates.pivots, given.laws.radius
    k, dimension = shape.coefficient("k"), shape.coefficient("d")
    diameter = 2 * a * (p / k) ** (1 / dimension)
    rate = fit.aggregation_coefficient(given, np.ones((p.size, p.size)))
    spheres = 2 * a * np.cbrt(p)
    adachi = fit.aggregation_coefficient(given, ADACHI * g * (spheres[:, None] + spheres[None]) ** 3)
    ceiling = float(np.sqrt(4 / (15 * np.pi)) * g)
    breakage = fit.breakage_coefficient(given, ceiling, 2 * a / diameter)
    coefficient = breakage.values["b"] * dissipation * a
    given_by = fit.what_it_gives(
        given,
        np.full((p.size, p.size), rate.values["C"]),
        ceiling * np.exp(-breakage.values["b"] * 2 * a / diameter),
        LAAKKONEN,
    )
    parts = fit.parts_of(given)
    first = given.rates.first_order
    assert first is not None
    comment = "\n".join(
        [
            f"{MARK}: populationBalance entries for OpenFOAM (multiphaseEuler), from {given.source}",
            f"g = {g:g} 1/s in laminar shear: let epsilon be {dissipation:g} m^2/s^3 at nu = {nu:g} m^2/s "
            f"(density {DENSITY:g} kg/m^3),",
            "so that (epsilon/nu)^(1/2) = g. For another density both nu and epsilon, and with it B, go as its inverse.",
            "",
            "No shipped coalescence model takes an efficiency. Efficiencies fall with size about as fast as "
            "cross sections grow, so that a "
            "constant K",
            f"comes nearest: residual {rate.words}; it is for this g, to which it is proportional. Where g "
            "varies, AdachiStuartFokkink",
            f"takes a mean efficiency in by Df 3 and alphaC {1 / adachi.values['C']:.6g} (its diameters are then "
            "no shape, and B would "
            f"have to be fitted to them): residual {adachi.words}.",
            "Shape: R = a (P/k)^(1/d), alphaC = k and Df = d.",
            f"Residual of S: {breakage.words}. S is of first order, in {first.words} at phi = {first.volume_fraction:g}.",
            "Laakkonen's daughters (C4 = 2: two of beta(3, 3)); parts of the table's parents are of "
            f"beta({parts.coefficient('c'):.3g}, "
            f"{parts.coefficient('c'):.3g}).",
            given_by,
        ]
    )
    group = {"shapeModel": "fractal", "Df": dimension, "alphaC": k, "kappa": 3.0 / a}
    entries = {
        "coalescenceModels": [("constant", {"rate": rate.values["C"]})],
        "binaryBreakupModels": "()",
        "breakupModels": [
            (
                "Kusters",
                {
                    "daughterSizeDistributionModel": "Laakkonen",
                    "C4": "2",
                    "B": coefficient,
                    "dP": 2 * a,
                    "kc": "1",
                    "Df": dimension,
                },
            )
        ],
        "sizeGroupShape": group,
        "continuousPhase": {"nu": nu, "epsilon": dissipation},
    }
    return {"populationBalance": file(comment, entries)}


TARGET = Target(
    title="OpenFOAM's population balance (multiphaseEuler)",
    files=files,
    notes={
        "populationBalance": "entries coalescenceModels, binaryBreakupModels and breakupModels for the population balance of "
        "constant/phaseProperties; sizeGroupShape for its size groups (kappa is the initial field of kappa); "
        "continuousPhase says what "
        "nu and epsilon must be"
    },
    cannot=(
        "Efficiencies: no shipped coalescence model takes one, so that one constant takes it in; K follows the table within the "
        "residual that the file states.",
        "Breakup by encounters: OpenFOAM knows breakup of first order alone. S is that of one population and "
        "volume fraction, and must "
        "be fitted anew for another.",
        "Tabulated daughters: the models shipped are laws; the numbers of daughters.csv would take a model "
        "of your own (calcNik).",
        "Shapes.",
    ),
    check="Run one cell at the stated epsilon and nu from primaries of the stated volume fraction: the mean size must "
    "settle near the "
    "last number in the file's comment, which is what these forms give.",
)

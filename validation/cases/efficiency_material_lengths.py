"""What the two lengths that the paper's scene leaves open do to eta_11: roughness and London wavelength."""

from __future__ import annotations

import numpy as np

from mcdem.figures.style import BLUE, VERMILION, canvas, legend
from validation.case import Case, Context, Findings, above, below

CHANGES = {
    "as in the paper": {},
    "twice l0": {"minimum_approach": "0.33 nm"},
    "half of lambda": {"london_wavelength": "50 nm"},
    "twice lambda": {"london_wavelength": "200 nm"},
}
CUTOFFS = (0.0, 5e-3)


def parts(context: Context):
    return {f"{what}, delta {delta:g}": [what, delta] for delta in CUTOFFS for what in CHANGES}


def measure(context: Context, part):
    from mcdem.encounter.capture_efficiency import pair_efficiency
    from validation.cases.efficiency_rests_on_delta import scene

    what, delta = part
    changed = {f"effects.van_der_waals.{key}": value for key, value in CHANGES[what].items()}
    found = pair_efficiency(scene(750, delta, **changed), 4 if context.quick else 8)
    return [found.efficiency, found.error]


def judge(context: Context, found):
    ratios = {}
    for delta in CUTOFFS:
        base, _ = found[f"as in the paper, delta {delta:g}"]
        for what in list(CHANGES)[1:]:
            value, _ = found[f"{what}, delta {delta:g}"]
            ratios[what, delta] = value / base - 1.0
    checks = []
    for (what, delta), change in ratios.items():
        said = f"{what}: change of eta_11, " + ("full lubrication" if delta == 0.0 else f"delta = {delta:g}")
        if "lambda" in what:
            checks.append(below(said, abs(change), 0.01))
        elif delta == 0.0:
            checks.append(above(said, abs(change), 0.2))
        else:
            checks.append(below(said, abs(change), 0.05))

    def draw():
        figure, axes = canvas(height=2.4)
        names = list(CHANGES)[1:]
        for delta, colour, marker, label in zip(
            CUTOFFS, (BLUE, VERMILION), "os", ("full lubrication", "δ = 5e-3")
        ):
            axes.plot(
                np.arange(3),
                [100 * ratios[n, delta] for n in names],
                marker,
                mfc="none",
                color=colour,
                label=label,
            )
        axes.axhline(0, color="k", lw=0.5)
        axes.set_xticks(range(3), [n.replace("lambda", "λ").replace("l0", "ℓ₀") for n in names])
        axes.set(ylabel="change of η₁₁ (%)", xlim=(-0.5, 2.5))
        legend(axes)
        return figure

    return Findings(
        tuple(checks), draw, "What the open lengths of the paper's scene do to the efficiency at 750 Pa."
    )


CASE = Case(
    chapter=3,
    claim="The London wavelength, which the paper does not give, hardly matters; the roughness l0 matters with full lubrication, "
    "hardly with the cut-off.",
    source="Frungieri & Vanni 2021, Table 1 (l0) and Eq. 12 (lambda); the scene's assumption of 100 nm",
    tolerance="hardly: 1 % for a factor of two in lambda, 5 % in l0; both small against the 15 % and more that delta does",
    measure=measure,
    judge=judge,
    parts=parts,
    seen=("no_lubrication", "delta_moved"),
)

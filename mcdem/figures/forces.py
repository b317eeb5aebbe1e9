"""Fig. 5: the force between two primaries against their gap, attached and not."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Canvas

from mcdem.effects import contact_force, non_contact_force
from mcdem.figures.figure import Figure, quantity
from mcdem.figures.style import BLACK, GREY, VERMILION, canvas
from mcdem.scene import Scene

NANOMETRE = 1e-9


def pair_force(scene: Scene) -> Figure | None:
    """Fig. 5, from the scene's own kernels; None where a scene lacks one of the two forces."""
    effects = scene.effects
    if effects.get("van_der_waals") is None or effects.get("jkr") is None:
        return None
    units, vdw, jkr = (
        scene.reduced,
        effects.get("van_der_waals").kernel(scene.reduced, scene.suspension, scene.effects),
        effects.get("jkr").kernel(scene.reduced, scene.suspension, scene.effects),
    )
    approach = effects.get("van_der_waals").minimum_approach
    apart = np.linspace(0.0, 30 * approach, 400)
    attached = np.linspace(2.2 * jkr.equilibrium_gap, jkr.pull_off_gap, 400) * units.length
    free = np.array([non_contact_force(h / units.length, 1.0, vdw, None, None)[0] for h in apart])
    held = np.array([contact_force(h / units.length, 1.0, jkr, None)[0] for h in attached])
    numbers = xr.Dataset(
        {
            "gap_apart": quantity(apart, "apart", "m", "surface gap h, not in contact"),
            "van_der_waals": quantity(
                free * units.force, "apart", "N", "van der Waals force, repulsion positive"
            ),
            "gap_attached": quantity(attached, "attached", "m", "surface gap h, in contact"),
            "jkr": quantity(held * units.force, "attached", "N", "JKR force, repulsion positive"),
            "equilibrium_gap": quantity(
                jkr.equilibrium_gap * units.length, (), "m", "gap of a free contact, h_eq"
            ),
            "pull_off_gap": quantity(jkr.pull_off_gap * units.length, (), "m", "gap of pull-off, h_po"),
            "pull_off_force": quantity(jkr.pull_off_force * units.force, (), "N", "pull-off force F_adh"),
        }
    )
    return Figure(
        "fig05_pair_force",
        "Force between two primaries against their surface gap: van der Waals apart, JKR in contact.",
        numbers,
        draw_pair_force,
    )


def draw_pair_force(numbers: xr.Dataset) -> Canvas:
    """Both branches, with h_eq and h_po."""
    figure, axes = canvas()
    axes.axhline(0, color=GREY, lw=0.5)
    axes.plot(
        numbers["gap_apart"] / NANOMETRE,
        numbers["van_der_waals"] / NANOMETRE,
        ":",
        color=BLACK,
        label="van der Waals",
    )
    axes.plot(
        numbers["gap_attached"] / NANOMETRE, numbers["jkr"] / NANOMETRE, color=VERMILION, label="JKR contact"
    )
    for name, words, height in (("equilibrium_gap", "$h_{eq}$", 0.96), ("pull_off_gap", "$h_{po}$", 0.88)):
        h = float(numbers[name]) / NANOMETRE
        axes.axvline(h, color=GREY, lw=0.6, ls="--")
        axes.text(
            h, height, f" {words} = {h:.3f} nm", transform=axes.get_xaxis_transform(), va="top", fontsize=6.5
        )
    adhesion = float(numbers["pull_off_force"]) / NANOMETRE
    axes.axhline(-adhesion, color=GREY, lw=0.6, ls=":")
    axes.text(
        0.98,
        -adhesion,
        f"$-F_{{adh}}$ = {-adhesion:.2f} nN",
        transform=axes.get_yaxis_transform(),
        ha="right",
        va="bottom",
        fontsize=6.5,
    )
    axes.set_xlim(float(numbers["gap_attached"].min()) / NANOMETRE, 2.2)
    axes.set_xlabel("surface gap  $h$ [nm]")
    axes.set_ylabel("force  $F$ [nN]")
    axes.legend(loc="center right")
    return figure

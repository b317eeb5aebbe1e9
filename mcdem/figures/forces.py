"""Fig. 5: the force between two primaries against their gap, attached and not."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import xarray as xr
from matplotlib.figure import Figure as Canvas

from mcdem.effects import ContactLaw, EffectTable, PairForce
from mcdem.effects.sums import contact_equilibrium, contact_force, contact_pull_off_gap, non_contact_force
from mcdem.figures.figure import Figure, quantity
from mcdem.figures.style import BLACK, GREY, VERMILION, canvas
from mcdem.scene import Scene

NANOMETRE = 1e-9


def pair_force(scene: Scene) -> Figure | None:
    """Fig. 5, from the scene's own laws; None where a scene lacks one of the two forces."""
    effects, units = scene.effects, scene.reduced
    if effects.attraction is None or effects.contact is None:
        return None
    pair_forces, contact, _ = scene.kernels
    (rest, _), pull_off = contact_equilibrium(1.0, contact), contact_pull_off_gap(1.0, contact)
    apart = np.linspace(0.0, 30 * effects.attraction.minimum_approach, 400)
    attached = np.linspace(2.2 * rest, pull_off, 400) * units.length
    free = np.array([non_contact_force(h / units.length, 1.0, pair_forces)[0] for h in apart])
    held = np.array([contact_force(h / units.length, 1.0, contact)[0] for h in attached])
    numbers = xr.Dataset(
        {
            "gap_apart": quantity(apart, "apart", "m", "surface gap h, not in contact"),
            "force_apart": quantity(
                free * units.force, "apart", "N", "force before contact, repulsion positive"
            ),
            "gap_attached": quantity(attached, "attached", "m", "surface gap h, in contact"),
            "force_attached": quantity(
                held * units.force, "attached", "N", "force of the contact, repulsion positive"
            ),
            "equilibrium_gap": quantity(rest * units.length, (), "m", "gap of a free contact, h_eq"),
            "pull_off_gap": quantity(pull_off * units.length, (), "m", "gap of pull-off, h_po"),
            "pull_off_force": quantity(
                effects.contact.pull_off_force(units.length), (), "N", "pull-off force F_adh"
            ),
        },
        attrs={
            "apart": titles_of(effects.present(PairForce).values()),
            "attached": titles_of(effects.present(ContactLaw).values()),
        },
    )
    return Figure(
        "fig05_pair_force",
        f"Force between two primaries against their surface gap: {numbers.attrs['apart']} apart, "
        f"{numbers.attrs['attached']} in contact.",
        numbers,
        draw_pair_force,
    )


def titles_of(tables: Iterable[EffectTable]) -> str:
    """The names of effects, as a legend has them."""
    return " + ".join(table.title for table in tables)


def draw_pair_force(numbers: xr.Dataset) -> Canvas:
    """Both branches, with h_eq and h_po."""
    figure, axes = canvas()
    axes.axhline(0, color=GREY, lw=0.5)
    axes.plot(
        numbers["gap_apart"] / NANOMETRE,
        numbers["force_apart"] / NANOMETRE,
        ":",
        color=BLACK,
        label=numbers.attrs["apart"],
    )
    axes.plot(
        numbers["gap_attached"] / NANOMETRE,
        numbers["force_attached"] / NANOMETRE,
        color=VERMILION,
        label=f"{numbers.attrs['attached']} contact",
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

"""Fig. 5: the force between two primaries against their gap, attached and not, by every law of the scene."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from mcdem.effects import EFFECTS, ContactLaw, EffectTable, PairForce
from mcdem.effects.sums import contact_equilibrium, contact_force, contact_pull_off_gap
from mcdem.figures.figure import Figure, NothingToShowError, quantity
from mcdem.figures.style import (
    BLACK,
    BLUE,
    COLUMN,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    canvas,
    headline,
    legend_below,
    plain_ticks,
)
from mcdem.scene import Scene

NANOMETRE = 1e-9
"""[m], and nanonewtons [N]."""
LENGTHS = 14.0
"""How many of its shortest lengths Fig. 5 spans."""
TINTS = (BLUE, GREEN, PURPLE, ORANGE, SKY)
"""Of the forces apart, none of them the contact's."""
FARTHEST, WEAKEST = 0.3, 1e-6
"""The range of the forces: gaps [a] up to where the sum is this part of its largest."""


def pair_force(scene: Scene) -> Figure:
    """Forces between two primaries against their gap, from the scene's own laws: each pair force, their sum, and the contact's
    (Frungieri & Vanni 2021, Fig. 5).

    Parameters
    ----------
    scene : Scene
        Whose effects are drawn.

    Returns
    -------
    Figure
        Its numbers [N] over the gap [m], and what draws them.

    Raises
    ------
    NothingToShowError
        Of a scene without forces between primaries.

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.figures import pair_force
    >>> figure = pair_force(mcdem.load_scene("scenes/dlvo-barrier.toml"))
    >>> figure.numbers["law"].values.tolist()
    ['van der Waals', 'double layer']
    >>> f"a contact is pulled off with {float(figure.numbers['pull_off_force']) * 1e9:.1f} nN"
    'a contact is pulled off with 11.1 nN'
    """
    effects, units = scene.effects, scene.reduced
    apart_laws, contact_laws = effects.present(PairForce), effects.present(ContactLaw)
    if not apart_laws and not contact_laws:
        raise NothingToShowError("fig05_pair_force: the scene has neither a pair force nor a law of contacts")
    shortest = (effects.step_length or 1e-3 * units.length) / units.length
    near = np.linspace(0.0, LENGTHS * shortest, 400)
    far = np.geomspace(0.3 * shortest, FARTHEST, 400)
    forces = [effect.force for name in apart_laws if isinstance(effect := EFFECTS[name], PairForce)]
    each = np.array(
        [
            [[force(h, 1.0, law)[0] for h in gaps] for gaps in (near, far)]
            for force, law in zip(forces, scene.kernels.pair_forces, strict=True)
        ]
    ).reshape(len(apart_laws), 2, 400)
    numbers = xr.Dataset(
        {
            "gap_apart": quantity(near * units.length, "apart", "m", "surface gap h, not in contact"),
            "gap_far": quantity(far * units.length, "far", "m", "surface gap h, not in contact"),
            "each_apart": quantity(
                each[:, 0] * units.force, ("law", "apart"), "N", "force of each law, repulsion positive"
            ),
            "each_far": quantity(
                each[:, 1] * units.force, ("law", "far"), "N", "force of each law, repulsion positive"
            ),
            "force_apart": quantity(
                each[:, 0].sum(axis=0) * units.force, "apart", "N", "sum before contact, repulsion positive"
            ),
            "force_far": quantity(
                each[:, 1].sum(axis=0) * units.force, "far", "N", "sum before contact, repulsion positive"
            ),
        },
        {"law": [table.title for table in apart_laws.values()]},
        {"apart": titles_of(apart_laws.values()), "attached": titles_of(contact_laws.values())},
    )
    if contact_laws:
        numbers = numbers.merge(_attached(scene), combine_attrs="override")
    words = [f"{numbers.attrs['apart']} apart"] * bool(apart_laws) + [
        f"{numbers.attrs['attached']} in contact"
    ] * bool(contact_laws)
    return Figure(
        "fig05_pair_force",
        f"Force between two primaries against their surface gap: {', '.join(words)}.",
        numbers,
        draw_pair_force,
    )


def _attached(scene: Scene) -> xr.Dataset:
    """The contact's force from twice its compression at rest to pull-off."""
    units, contact = scene.reduced, scene.kernels.contact
    (rest, _), pull_off = contact_equilibrium(1.0, contact), contact_pull_off_gap(1.0, contact)
    gap = np.linspace(2.2 * rest, pull_off, 400) * units.length
    held = np.array([contact_force(h / units.length, 1.0, contact)[0] for h in gap])
    strength = scene.effects.contact.pull_off_force(units.length)
    return xr.Dataset(
        {
            "gap_attached": quantity(gap, "attached", "m", "surface gap h, in contact"),
            "force_attached": quantity(
                held * units.force, "attached", "N", "force of the contact, repulsion positive"
            ),
            "equilibrium_gap": quantity(rest * units.length, (), "m", "gap of a free contact, h_eq"),
            "pull_off_gap": quantity(pull_off * units.length, (), "m", "gap of pull-off, h_po"),
            "pull_off_force": quantity(strength, (), "N", "pull-off force F_adh"),
        }
    )


def titles_of(tables: Iterable[EffectTable]) -> str:
    """The names of effects, as a legend has them."""
    return " + ".join(table.title for table in tables)


def draw_pair_force(numbers: xr.Dataset) -> Canvas:
    """Near contact on plain axes; where several forces add, their sizes over their whole range beside it.

    A barrier of a double layer is a hundredth of a contact's pull-off force: no plain axis shows both.
    """
    laws = numbers.sizes["law"]
    both = laws > 1
    figure, grid = canvas(COLUMN * (1.9 if both else 1.0), 3.1, ncols=1 + both, squeeze=False)
    _draw_near(grid[0, 0], numbers)
    if both:
        _draw_range(grid[0, 1], numbers)
    legend_below(figure, ncols=4 if both else 2)
    return figure


def _draw_near(axes: Axes, numbers: xr.Dataset) -> None:
    laws = numbers.sizes["law"]
    axes.axhline(0, color=GREY, lw=0.5)
    gap = numbers["gap_apart"].values / NANOMETRE
    force = numbers["force_apart"].values / NANOMETRE
    seen = [0.0]
    ends = [0.0, gap[-1]]
    if laws > 1:
        for k in range(laws):
            axes.plot(
                gap,
                numbers["each_apart"][k] / NANOMETRE,
                color=TINTS[k % len(TINTS)],
                lw=0.8,
                label=str(numbers["law"][k].item()),
            )
        axes.plot(gap, force, color=BLACK, lw=1.4, label="sum apart")
    elif laws:
        axes.plot(gap, force, color=BLACK, lw=1.2, label=f"{numbers.attrs['apart']}, apart")
    if "force_attached" in numbers:
        held = numbers["force_attached"].values / NANOMETRE
        at = numbers["gap_attached"].values / NANOMETRE
        strength = float(numbers["pull_off_force"]) / NANOMETRE
        axes.plot(at, held, color=VERMILION, lw=1.4, ls="-.", label=f"{numbers.attrs['attached']} contact")
        told = []
        for name, words, line in (("equilibrium_gap", "h_{eq}", "--"), ("pull_off_gap", "h_{po}", ":")):
            h = float(numbers[name]) / NANOMETRE
            axes.axvline(h, color=GREY, lw=0.7, ls=line, label=f"${words}$ = {h:.3g} nm")
        told.append(f"$F_{{adh}}$ = {strength:.3g} nN")
        headline(axes, ", ".join(told))
        seen += [*held, -strength]
        ends += [at[0], at[-1]]
    if laws:
        # Not how a short-range wall ends, but where it meets the rest.
        inside = force[np.abs(force) <= 3.0 * max(np.abs(seen).max(), np.abs(np.minimum(force, 0.0)).max())]
        seen += inside.tolist()
    low, high = min(seen), max(seen)
    margin = 0.06 * max(high - low, 1e-12)
    axes.set_ylim(low - margin, high + margin)
    axes.set_xlim(min(ends), max(ends))
    axes.set(xlabel="surface gap  $h$ [nm]", ylabel="force  $F$ [nN], repulsion positive")


def _draw_range(axes: Axes, numbers: xr.Dataset) -> None:
    """Sizes on logarithmic axes, full where they repel and dashed where they attract."""
    gap = numbers["gap_far"].values / NANOMETRE
    total = numbers["force_far"].values / NANOMETRE
    series = [
        (numbers["each_far"][k].values / NANOMETRE, TINTS[k % len(TINTS)], 0.8)
        for k in range(numbers.sizes["law"])
    ]
    for values, tint, thick in (*series, (total, BLACK, 1.4)):
        for sign, line in ((1, "-"), (-1, "--")):
            shown = np.where(sign * values > 0, np.abs(values), np.nan)
            if np.isfinite(shown).any():
                axes.plot(gap, shown, line, color=tint, lw=thick)
    # A wall of a twelfth power would squeeze all else.
    top = 30.0 * float(np.nanmax(np.where(total < 0, -total, np.nan), initial=0.0)) or float(
        np.abs(total).max()
    )
    reached = gap[np.abs(total) >= WEAKEST * top]
    axes.set(
        xscale="log", yscale="log", xlabel="surface gap  $h$ [nm]", ylabel="size of the force  $|F|$ [nN]"
    )
    axes.set_xlim(gap[0], max(reached[-1], 3 * gap[0]))
    axes.set_ylim(WEAKEST * top, 2.0 * top)
    plain_ticks(axes.xaxis)
    headline(axes, "full: repulsion, dashed: attraction")

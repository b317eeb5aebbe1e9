"""What a scene's numbers say before it is run: the groups that decide which physics matters, and the range of its numerics.

Each finding is a number, the bound that it is compared with and a sentence.  "fine" needs no thought, "note" is worth knowing
when results are read, "warning" says that the scene leaves out something that matters or steps past a limit.

Temperature and densities decide only about what is *not* simulated, so a scene does not give them; the values assumed here
are ordinary ones, and the groups are proportional to them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from mcdem.monte_carlo.expected_output import LARGE, MANY_SNAPSHOTS, VERY_LARGE, output_of
from mcdem.quantities.linear_flows import gradient

if TYPE_CHECKING:
    from mcdem.scene import Scene

BOLTZMANN = 1.380649e-23
"""[J/K]"""
TEMPERATURE = 298.15
"""Assumed [K]."""
DENSITY = 1000.0
"""Assumed of medium and particles [kg/m^3]."""
LARGE_AGGREGATE = 10.0
"""Outer radius of a large aggregate over that of its primaries, for groups that grow with size."""

Verdict = Literal["fine", "note", "warning"]


@dataclass(frozen=True)
class Finding:
    """One number of a scene and what it says.

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.analysis import check
    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> [finding.name for finding in check(scene) if finding.verdict == "warning"]
    []
    """

    name: str
    value: float
    verdict: Verdict
    words: str
    """A sentence that holds the bound that decided."""


def check(scene: Scene) -> list[Finding]:
    """All findings on a scene, the physics first, then the numerics.

    Parameters
    ----------
    scene : Scene
        What is judged; nothing is run.

    Returns
    -------
    list of Finding
        Each a number without unit, a verdict and a sentence that holds the bound that decided.

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.analysis import check

    The same latex in water, where Brownian motion rivals the shear:

    >>> scene = mcdem.load_scene("scenes/paper-1000Pa.toml")
    >>> slow = scene.with_changes({"flow.shear_rate": "10 1/s", "flow.viscosity": "1 mPa s"})
    >>> first = check(slow)[0]
    >>> first.verdict, round(first.value, 1)
    ('warning', 5.7)
    """
    return [
        *_sizes(scene),
        *_left_out(scene),
        *_holding(scene),
        *_barrier(scene),
        *_capture(scene),
        *_frozen_matrix(scene),
        *_dilution(scene),
        *_numerics(scene),
        *_output(scene),
    ]


def warnings_before(scene: Scene, until: float | None = None, events: int | None = None) -> list[str]:
    """What is worth a line before a run begins: the size of what it writes, if large, and what `check` warns of.

    Parameters
    ----------
    until [s], events : where the run is to stop, instead of the scene's
    """
    expected = output_of(scene, until, events)
    lines = [f"note: {expected.words}"] if expected is not None and expected.large else []
    # Of another stop than the scene's: its output would be counted twice.
    endless = scene.model_copy(update={"run": scene.run.model_copy(update={"until": None, "events": None})})
    found = (finding for finding in check(endless) if finding.verdict == "warning")
    return lines + [f"warning: {finding.name} = {finding.value:.3g}: {finding.words}" for finding in found]


def of_several(scene: Scene, which: str) -> str:
    """Which primaries a number is of, where the suspension has several radii."""
    return "" if scene.suspension.radii is None else f", {which}"


def _sizes(scene: Scene) -> Iterator[Finding]:
    """Primaries of several radii: how far apart, and of which of them the rest speaks."""
    radii, shares = scene.suspension.radii, scene.suspension.number_fractions
    if radii is None or shares is None:
        return
    volumes = [share * radius**3 for share, radius in zip(shares, radii, strict=True)]
    least = min(volumes) / math.fsum(volumes)
    which = radii[volumes.index(min(volumes))]
    words = f"the primaries of {which:g} m are {least:.2g} of the volume; numbers below are of the largest unless they say so"
    yield Finding("smallest over largest radius", min(radii) / max(radii), "note", words)


def _left_out(scene: Scene) -> Iterator[Finding]:
    """Brownian motion and inertia: never simulated, so they must not matter."""
    a, mu, g = scene.suspension.radius, scene.flow.viscosity, scene.flow.shear_rate

    smallest = min(scene.suspension.species)
    peclet = 6.0 * math.pi * mu * smallest**3 * g / (BOLTZMANN * TEMPERATURE)
    name = "Peclet number 6 pi mu a^3 g/kT" + of_several(scene, "the smallest primaries")
    if peclet > 1e3:
        yield Finding(name, peclet, "fine", "Brownian motion cannot matter (above 1000, at 298 K)")
    elif peclet > 10:
        yield Finding(
            name,
            peclet,
            "note",
            "Brownian motion, not simulated, may shift captures of primaries (below 1000)",
        )
    else:
        yield Finding(
            name, peclet, "warning", "Brownian motion matters and is not simulated (below 10, at 298 K)"
        )

    size = f"aggregate of {LARGE_AGGREGATE:g} a" + of_several(scene, "the largest primaries")
    reynolds = DENSITY * g * (LARGE_AGGREGATE * a) ** 2 / mu
    stokes = 2.0 / 9.0 * reynolds
    for name, value, what in [
        (f"Reynolds number of an {size}", reynolds, "the fluid's inertia"),
        (f"Stokes number of an {size}", stokes, "the particles' inertia"),
    ]:
        if value < 0.01:
            yield Finding(name, value, "fine", f"{what} cannot matter (below 0.01)")
        elif value < 0.1:
            yield Finding(
                name, value, "note", f"{what}, not simulated, is seen by the largest aggregates (0.01 to 0.1)"
            )
        else:
            yield Finding(name, value, "warning", f"{what} matters and is not simulated (above 0.1)")


def _holding(scene: Scene) -> Iterator[Finding]:
    """What holds aggregates together, and whether its parameters agree."""
    from mcdem.effects import EFFECTS, ContactLaw

    effects, unit = scene.effects, scene.reduced
    van_der_waals, contact = effects.attraction, effects.contact

    if contact is not None:
        cohesion = unit.force / contact.pull_off_force(unit.length)
        name = "cohesion number 6 pi mu a^2 g/F_adh"
        # A touching doublet is pulled apart with at most 6.12 pi mu a^2 g in simple shear, whose strain stretches at g/2.
        doublet = 6.12 / 6.0 * cohesion * 2.0 * stretching(scene)
        # What the frozen resistance leaves of that is what a simulated doublet bears.
        borne = doublet * _share_of_frozen(scene)
        if borne > 1.0:
            words = f"the flow parts even doublets (pull {borne:.2g} F_adh): no aggregate lasts"
            yield Finding(name, cohesion, "warning", words)
        elif doublet > 1.0:
            words = (
                f"the exact pull on a doublet, {doublet:.3g} F_adh, parts it; with cutoff_convention = "
                f'"matrix" it bears {borne:.2g} F_adh and holds'
            )
            yield Finding(name, cohesion, "warning", words)
        elif doublet > 0.05:
            words = f"doublets hold (pull {doublet:.2g} F_adh), larger aggregates are within reach of breakup"
            yield Finding(name, cohesion, "fine", words)
        else:
            words = f"doublets feel {doublet:.2g} F_adh: only large aggregates break, and they will be costly to follow"
            yield Finding(name, cohesion, "note", words)
    elif not effects.parted:
        words = (
            f"attraction and no law of contact: add [effects.{effects.contact_laws[0]}], or nothing stops the primaries "
            "where they meet"
            if van_der_waals is not None
            else "neither attraction nor contacts: nothing sticks, every encounter is a miss"
        )
        yield Finding("contact laws", 0.0, "warning" if van_der_waals is not None else "note", words)

    if contact is not None and van_der_waals is not None:
        work = 2.0 * contact.surface_energy
        ratio = work / van_der_waals.work_of_adhesion()
        name = "work of adhesion over A_H/(12 pi l0^2)"
        if 0.5 < ratio < 2.0:
            yield Finding(
                name,
                ratio,
                "fine",
                "contact and van der Waals attraction describe the same surface (0.5 to 2)",
            )
        else:
            words = "contact and van der Waals attraction disagree on the adhesion (outside 0.5 to 2)"
            yield Finding(name, ratio, "note", words)

    if contact is not None:
        reach = van_der_waals.minimum_approach if van_der_waals is not None else 0.165e-9
        tabor = tabor_number(
            0.5 * scene.suspension.radius,
            2.0 * contact.surface_energy,
            contact.elastic_modulus / (2.0 * (1.0 - contact.poisson_ratio**2)),
            reach,
        )
        name = "Tabor number"
        laws: list[Any] = [law.table for law in EFFECTS.values() if isinstance(law, ContactLaw)]
        right = next((law for law in laws if law.tabor_numbers[0] < tabor < law.tabor_numbers[1]), None)
        if right is not None:
            fits = isinstance(contact, right)
            words = f"{right.title} contacts are right ({right.tabor_range()})"
            words += "" if fits else f", the scene has {contact.title}"
            yield Finding(name, tabor, "fine" if fits else "warning", words)
        else:
            told = " and ".join(f"{law.title} ({law.tabor_range()})" for law in laws)
            words = f"between {told}, whose pull-off forces differ by a third"
            yield Finding(name, tabor, "note", words)

    if van_der_waals is not None:
        ratio = van_der_waals.at_contact(scene.suspension.radius) / unit.force
        name = "van der Waals force at contact over 6 pi mu a^2 g"
        # At 0.1 it is 2 % of eta_11 of two primaries (tests/analysis/test_check.py).
        if ratio < 0.1:
            words = "attraction before contact should hardly matter (below 0.1): try without"
            yield Finding(name, ratio, "note", words)
        else:
            yield Finding(name, ratio, "fine", "attraction before contact may decide on captures (above 0.1)")


def _barrier(scene: Scene) -> Iterator[Finding]:
    """How much of the captures the double layer takes: computed where that is cheap, else judged by its force."""
    if scene.effects.get("double_layer") is None:
        return
    import numpy as np

    from mcdem.effects import PairForce
    from mcdem.effects.sums import non_contact_force

    thickness = min(scene.suspension.species) / scene.effects.get("double_layer").debye_length
    if thickness > 20.0:
        yield Finding(
            "kappa a", thickness, "fine", "the double layer is thin against the particles (above 20)"
        )
    else:
        yield Finding(
            "kappa a", thickness, "note", "the double layer is hardly thin against the particles (10 to 20)"
        )
    laws, walls = scene.kernels.pair_forces, scene.effects.present(PairForce).values()
    # Without the wall that keeps spheres from contact: it is no barrier but the place where they come to rest.
    pair_forces = tuple(law for law, table in zip(laws, walls, strict=True) if not table.keeps_apart)
    barrier = max(non_contact_force(h, 1.0, pair_forces)[0] for h in np.geomspace(1e-6, 1.0, 400))
    name = "largest repulsion before contact over 6 pi mu a^2 g"
    # A twentieth of the viscous force already decides over grazing pairs: no bound on it says how many are captured.
    if (
        scene.effects.contact is None
        or scene.suspension.radii is not None
        or scene.flow.kind != "simple_shear"
    ):
        yield Finding(
            name, barrier, "note", "the double layer may change captures: compare drawn encounters without it"
        )
        return
    yield Finding(name, barrier, "note", "what the double layer does to captures is computed below")
    with_it, without = eta_with_and_without(scene, "effects.double_layer")
    name = "eta_11 with the double layer over that without"
    told = f"{with_it:.3g} against {without:.3g}, from {RAYS} directions"
    ratio = with_it / without if without else math.nan
    if not without:
        yield Finding(name, 0.0, "note", "nothing is captured even without the double layer")
    elif abs(ratio - 1.0) <= 0.02:
        yield Finding(name, ratio, "fine", f"the double layer hardly changes captures (within 2 %: {told})")
    elif ratio > 0.05:
        yield Finding(name, ratio, "note", f"the double layer changes captures (by more than 2 %: {told})")
    else:
        yield Finding(name, ratio, "warning", f"the double layer keeps primaries apart (below 0.05: {told})")


RAYS = 2
"""Directions of eta_11 in a finding: two give it to a few per cent."""


def eta_with_and_without(scene: Scene, key: str) -> tuple[float, float]:
    """eta_11 of two primaries of the scene, and of the scene without what `key` names; from the boundaries of capture."""
    from mcdem.analysis.paired_encounters import efficiency
    from mcdem.integrators import DEFAULT

    implicit = scene.with_changes({"numerics.scheme": DEFAULT})
    return efficiency(implicit, RAYS), efficiency(implicit.with_changes({key: None}), RAYS)


def _capture(scene: Scene) -> Iterator[Finding]:
    """Where captures of primaries are decided, and which parts of the fluid's model matter there."""
    a, cutoff = scene.suspension.radius, scene.hydrodynamics.lubrication_cutoff
    van_der_waals = scene.effects.attraction
    if van_der_waals is None:
        return
    attraction = van_der_waals.number(scene.flow.shear_stress, a)
    name = "attraction number C_A = A_H/(36 pi mu g a^3)"
    if scene.flow.kind != "simple_shear" or scene.suspension.radii is not None:
        words = "laws of eta_11 are of equal primaries in simple shear: count drawn encounters"
        yield Finding(name, attraction, "note", words)
    elif attraction < 1e-4:
        words = "eta_11 is below the range of the law 0.95 C_A^0.18 (above 1e-4): compute it"
        yield Finding(name, attraction, "note", words)
    else:
        yield Finding(
            name,
            attraction,
            "fine",
            "eta_11 may follow 0.95 C_A^0.18 (van de Ven & Mason 1977; above 1e-4): `mcdem efficiency` computes it",
        )

    # Attraction A_H a/12h^2 against the pull of the flow, 6 pi mu a^2 g: h/a = (C_A/2)^(1/2).
    gap = math.sqrt(0.5 * attraction)
    roughness = van_der_waals.minimum_approach / a
    name = "cut-off delta over the gap of capture (C_A/2)^(1/2)"
    if not scene.hydrodynamics.lubrication:
        words = f'level = "{scene.hydrodynamics.level}" is without lubrication: nothing holds pairs apart on their last way'
        yield Finding("gap of capture (C_A/2)^(1/2) over a", gap, "note", words)
    elif cutoff == 0.0:
        yield Finding(name, 0.0, "note", "lubrication without a cut-off: eta_11 depends on l0 instead")
    elif cutoff > gap:
        words = f"captures are decided at gaps near {gap * a:.2g} m, inside the cut-off: eta_11 may depend on delta (above 1)"
        yield Finding(name, cutoff / gap, "note", words)
    else:
        yield Finding(
            name,
            cutoff / gap,
            "fine",
            "captures are decided outside the cut-off: eta_11 should hardly depend on delta (below 1)",
        )
    wavelength = van_der_waals.reach
    if wavelength is not None:
        retardation = 2.0 * math.pi * (gap * a + van_der_waals.minimum_approach) / wavelength
        name = "retardation 2 pi (h + l0)/lambda at that gap"
        if retardation < 0.1:
            words = "retardation should hardly matter for captures (below 0.1)"
        else:
            words = "retardation weakens the attraction where captures are decided and may lower eta_11 (above 0.1)"
        yield Finding(name, retardation, "fine", words)
    if cutoff > 0.0 and scene.hydrodynamics.lubrication:
        name = "cut-off delta over l0/a"
        if cutoff > 0.1:
            words = "the cut-off is beyond 0.1 a: little of lubrication is left"
            yield Finding(name, cutoff / roughness, "warning", words)
        elif cutoff < roughness:
            words = "lubrication is resolved below the molecular roughness l0 (below 1)"
            yield Finding(name, cutoff / roughness, "note", words)
        else:
            words = f"lubrication ends {cutoff * a:.2g} m from contact, above the molecular roughness l0 (above 1)"
            yield Finding(name, cutoff / roughness, "fine", words)


def _frozen(scene: Scene) -> bool:
    """Whether contacts rest where the resistance is frozen."""
    fluid = scene.hydrodynamics
    return scene.effects.contact is not None and fluid.lubrication and fluid.cutoff_convention == "matrix"


def _frozen_gap(scene: Scene) -> float:
    """Gap over a, below which the resistance is frozen."""
    from mcdem.hydrodynamics.two_sphere.tables import SMALLEST_GAP

    return max(scene.hydrodynamics.lubrication_cutoff, SMALLEST_GAP)


def _frozen_over_overlap(scene: Scene) -> float:
    """That gap over the overlap of a contact at rest."""
    return _frozen_gap(scene) / -_contact_at_rest(scene)[0]


def _share_of_frozen(scene: Scene) -> float:
    """What a touching doublet bears of its exact tension."""
    return doublet_share(_frozen_gap(scene), -_contact_at_rest(scene)[0]) if _frozen(scene) else 1.0


def _frozen_matrix(scene: Scene) -> Iterator[Finding]:
    """Whether contacts lie so far below the cut-off that the strain squeezes them through the frozen resistance."""
    if not _frozen(scene):
        return
    ratio, share = _frozen_over_overlap(scene), _share_of_frozen(scene)
    name = "cut-off delta over the overlap of a contact at rest"
    if share > 0.0:
        told = f'with cutoff_convention = "matrix" a touching doublet bears {share:.2g} of its exact tension'
    else:
        told = 'with cutoff_convention = "matrix" the flow presses a touching doublet together where it should pull'
    if ratio > 5.0:
        yield Finding(name, ratio, "fine", f"contacts rest well above minus delta (above 5): {told}")
    elif ratio > 1.0:
        yield Finding(name, ratio, "note", f"contacts overlap by a good part of delta (1 to 5): {told}")
    else:
        words = f'contacts overlap by more than delta (below 1): {told}; choose cutoff_convention = "gap"'
        yield Finding(name, ratio, "warning", words)


def _dilution(scene: Scene) -> Iterator[Finding]:
    """Encounters are binary: each must be over before the next begins."""
    flow = scene.flow
    # Each primary meets 8 phi g/pi others in unit time at the start (Eq. 2 over N/2 pairs each).
    between = (
        math.pi / (8.0 * scene.suspension.volume_fraction) * flow.shear_rate / flow.equivalent_shear_rate
    )
    # Mean approach z0/y0 over the flux is 3 pi/4 of start_distance; where the flow stretches it is about its logarithm.
    approach = 3.0 * math.pi / 4.0 * scene.numerics.start_distance
    if flow.kind != "simple_shear":
        approach = min(approach, (1.0 + math.log(scene.numerics.start_distance)) / stretching(scene))
    # Then the rotations of Eq. 21.
    length = approach + 4.0 * math.pi * scene.numerics.rotations
    ratio = length / between
    name = "simulated time of an encounter over the time between two"
    told = f"strain {length:.0f} against {between:.0f}, phi = {scene.suspension.volume_fraction:g}"
    if ratio < 0.1:
        yield Finding(name, ratio, "fine", f"encounters are binary (below 0.1: {told})")
    elif ratio < 1.0:
        yield Finding(
            name, ratio, "note", f"aggregates may meet a third one while they restructure (0.1 to 1: {told})"
        )
    else:
        yield Finding(name, ratio, "warning", f"too crowded for binary encounters (above 1: {told})")


def _output(scene: Scene) -> Iterator[Finding]:
    """What the run will write, where that is much."""
    output = output_of(scene)
    if output is not None and output.large:
        yield Finding(
            "bytes of the dataset",
            output.size,
            "warning" if output.size > VERY_LARGE else "note",
            f"{output.words} (a note from {LARGE:.0e} bytes or {MANY_SNAPSHOTS} snapshots on, a warning from {VERY_LARGE:.0e})",
        )


def _numerics(scene: Scene) -> Iterator[Finding]:
    """Steps against the fastest motion, that of a contact."""
    from mcdem.integrators import SCHEMES

    numerics = scene.numerics
    if scene.effects.contact is not None:
        relaxation = contact_relaxation(scene)
        base = numerics.of("explicit_euler").base_step
        ratio = base / relaxation
        name = "paper's step dt_b over a contact's relaxation time"
        told = f"{relaxation:.2g} s; explicit steps are unstable above 2, near 1 under compression"
        used = numerics.scheme == "explicit_euler"
        other = "" if used else "; the scheme of this scene has no such limit"
        if ratio < 0.3:
            yield Finding(name, ratio, "fine", f"dt_b resolves the contacts ({told}){other}")
        elif ratio < 2.0:
            yield Finding(name, ratio, "note", f"dt_b is near the contact's relaxation time ({told}){other}")
        else:
            words = f"dt_b is past the limit of explicit steps ({told}){other}"
            yield Finding(name, ratio, "warning" if used else "note", words)
    if SCHEMES[numerics.scheme].step_in_strain:
        step = numerics.step
        name = "longest step, in strain"
        if step <= 0.1:
            yield Finding(name, step, "fine", "turning aggregates are resolved (up to 0.1)")
        elif step <= 0.25:
            yield Finding(
                name, step, "note", "bond tensions of turning aggregates are several per cent low (above 0.1)"
            )
        else:
            yield Finding(name, step, "warning", "turning aggregates are not resolved (above 0.25)")
    if numerics.start_distance < 3.0:
        words = "encounters start where the aggregates already interact (below 3)"
        yield Finding("start distance over R_i + R_j", numerics.start_distance, "note", words)


def stretching(scene: Scene) -> float:
    """Largest rate of stretching over g: 1/2 in simple shear."""
    import numpy as np

    G = gradient(scene.flow)
    return float(np.linalg.eigvalsh(0.5 * (G + G.T))[-1])


def tabor_number(radius: float, work: float, modulus: float, reach: float) -> float:
    """(R w^2/(E*^2 z0^3))^(1/3) of two spheres (Tabor 1977).

    radius : reduced radius a1 a2/(a1 + a2) [m];  work : of adhesion [J/m^2];  modulus : reduced, E* [Pa]
    reach : range z0 of the attraction [m]
    """
    return (radius * work**2 / (modulus**2 * reach**3)) ** (1.0 / 3.0)


def doublet_share(cutoff: float, overlap: float) -> float:
    """Tension of a touching doublet over its exact one, where the resistance is frozen at the cut-off; lengths in a.

    Beside the tension T of the exact problem, 6.12 pi mu a^2 g, the strain g/2 at the true distance moves the surfaces together
    (cut-off + overlap)/2 too fast against the damping 6 pi mu a/(4 delta) of the cut-off.
    """
    return 1.0 - (1.0 + overlap / cutoff) / 8.0 / (6.12 / 6.0)


def contact_relaxation(scene: Scene) -> float:
    """Time [s] in which a contact of two primaries falls back to its equilibrium gap: squeeze-film damping over stiffness.

    The damping is the leading term 6 pi mu a/(4 delta) of lubrication at the cut-off, or at l0/a without one; where the scene
    has no lubrication, that of two touching spheres at its level of hydrodynamics.
    """
    from mcdem.hydrodynamics import LEVELS

    unit = scene.reduced
    van_der_waals = scene.effects.attraction
    roughness = van_der_waals.minimum_approach / unit.length if van_der_waals is not None else 3e-4
    gap = scene.hydrodynamics.lubrication_cutoff or roughness
    _, stiffness = _contact_at_rest(scene)
    return float(unit.time * LEVELS[scene.hydrodynamics.level].squeeze(gap) / stiffness)


def _contact_at_rest(scene: Scene) -> tuple[float, float]:
    """(gap, stiffness) of a contact of two primaries without load, in reduced units; the scene has a contact law."""
    from mcdem.effects import EFFECTS, ContactLaw

    law = EFFECTS[scene.effects.contact_name]
    assert isinstance(law, ContactLaw)
    return law.at_rest(1.0, scene.kernels.contact)

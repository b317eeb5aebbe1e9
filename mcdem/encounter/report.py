"""An encounter in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mcdem.encounter.simulate import PAPER_BREAKUP, STRICT_BREAKUP, EncounterResult

if TYPE_CHECKING:
    from mcdem.scene import Scene


def encounter_report(scene: Scene, result: EncounterResult) -> list[str]:
    """What came of an encounter, in words: lines of a name and a value."""
    rate = scene.flow.shear_rate
    strict = "breakup" if result.outcome in STRICT_BREAKUP else "no breakup"
    convention = {True: f" (breakup as the paper counts it; read strictly, {strict})", False: ""}
    rows = [("outcome", result.outcome + convention[result.outcome in PAPER_BREAKUP])]
    if result.reason:
        rows.append(("reason", result.reason))
    rows += [
        ("products", " + ".join(str(product.size) for product in result.products) + " primaries"),
        ("offset", f"x0 = {result.offset[0]:.4g} m, y0 = {result.offset[1]:.4g} m"),
        ("simulated", _time(result.simulated_time, rate)),
        ("first contact", _time(result.first_contact_time, rate)),
        ("last bond change", _time(result.last_bond_change_time, rate)),
        ("smallest gap", f"{result.smallest_gap:.3g} m"),
        ("largest tension", _tension(scene, result.largest_tension)),
        ("effort", f"{result.steps} steps, {result.cpu_time:.3g} s of processor time"),
    ]
    width = max(len(name) for name, _ in rows)
    return [f"{name:{width}}  {value}" for name, value in rows]


def _time(seconds: float, rate: float) -> str:
    return "none" if seconds != seconds else f"{seconds:.4g} s (strain {seconds * rate:.4g})"


def _tension(scene: Scene, tension: float) -> str:
    contact = scene.effects.contact
    if tension <= 0.0 or contact is None:
        return "none" if tension <= 0.0 else f"{tension:.3g} N"
    pull_off = contact.pull_off_force(scene.suspension.radius)
    return f"{tension:.3g} N ({tension / pull_off:.2f} of pull-off)"

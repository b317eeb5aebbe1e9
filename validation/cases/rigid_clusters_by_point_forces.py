"""Drag of touching rigid clusters, and how rods of touching spheres turn in shear."""

from __future__ import annotations

import numpy as np

from mcdem.figures.style import BLUE, VERMILION, canvas, legend
from validation.case import Case, Context, Findings, Verdict, below, near

GAP = 1e-4
SIDE = 2.0 + GAP


def chain(n: int):
    """(n, 3) spheres in a row along z, about their centre."""
    return SIDE * (np.arange(n) - 0.5 * (n - 1))[:, None] * [0.0, 0.0, 1.0]


def polygon(n: int):
    """(n, 3) spheres on a regular polygon in the plane z = 0."""
    angle = 2 * np.pi * np.arange(n) / n
    return SIDE / (2 * np.sin(np.pi / n)) * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)


TETRAHEDRON = SIDE / np.sqrt(8) * np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
CLUSTERS = {
    "doublet": chain(2),
    "chain of 3": chain(3),
    "triangle": polygon(3),
    "chain of 4": chain(4),
    "square": polygon(4),
    "tetrahedron": TETRAHEDRON,
}
QUICK = ("doublet", "chain of 3", "triangle", "tetrahedron")
GAP_OF_METHOD = (
    "Stokesian dynamics' own error: lubrication is pairwise and moments beyond the stresslet are left out, "
    "which matters most where every sphere touches several"
)


def parts(context: Context):
    return {name: name for name in (QUICK if context.quick else CLUSTERS)}


def measure(context: Context, name: str):
    from validation.exact import point_forces
    from validation.exact.settling import mobility, rigid_motions, scene

    positions, paper = CLUSTERS[name], scene()
    n = len(positions)
    rigid = rigid_motions(positions)
    whole = point_forces.resistance(positions, np.ones(n), 150, close=0.0)
    exact = rigid.T @ whole[: 6 * n, : 6 * n] @ rigid
    inverse = np.linalg.inv(mobility(paper, positions))
    ours = rigid.T @ inverse @ rigid
    result = {"exact": np.diag(exact), "toolkit": np.diag(ours)}
    if "chain" in name or n == 2:
        result["rates"] = [
            [turned(paper, positions, axis, inverse) for axis in "yz"],
            [turned_exactly(positions, axis, whole) for axis in "yz"],
        ]
    return result


def along(positions, axis: str):
    """The chain laid along the gradient y or along the flow z."""
    return positions if axis == "z" else positions[:, [0, 2, 1]]


def turned(scene, positions, axis, inverse):
    """Angular velocity about the vorticity, over g, of the chain as a rigid body free of force and torque."""
    import mcdem
    from validation.exact.settling import mobility, rigid_motions

    x = along(positions, axis)
    resistance = inverse if axis == "z" else np.linalg.inv(mobility(scene, x))
    free = mcdem.velocities(scene, x * scene.suspension.radius)
    rates = np.concatenate(
        [free.linear.ravel() / scene.reduced.velocity, free.angular.ravel() * scene.reduced.time]
    )
    rigid = rigid_motions(x)
    return np.linalg.solve(rigid.T @ resistance @ rigid, rigid.T @ resistance @ rates)[3]


def turned_exactly(positions, axis, whole):
    """The same from the exact resistance, without the toolkit's solver."""
    from mcdem.hydrodynamics.two_sphere.tensors import STRAIN_BASIS
    from validation.exact import point_forces
    from validation.exact.settling import rigid_motions

    x = along(positions, axis)
    n = len(x)
    if axis != "z":
        whole = point_forces.resistance(x, np.ones(n), 150, close=0.0)
    strain = np.array([[0, 0, 0], [0, 0, 0.5], [0, 0.5, 0]])
    five = np.tile(np.tensordot(STRAIN_BASIS, strain, axes=2), n)
    flow = np.zeros((n, 3))
    flow[:, 2] = x[:, 1]
    ambient = np.concatenate([flow.ravel(), np.tile([0.5, 0, 0], n)])
    rigid, still = rigid_motions(x), whole[: 6 * n, : 6 * n]
    load = rigid.T @ (still @ ambient + whole[: 6 * n, 6 * n :] @ five)
    return np.linalg.solve(rigid.T @ still @ rigid, load)[3]


def axis_ratio(rates):
    """Axis ratio of the spheroid that turns alike: rates along gradient and flow are as its square to one (Jeffery 1922)."""
    return float(np.sqrt(rates[0] / rates[1]))


def judge(context: Context, found):
    checks = []
    for name, numbers in found.items():
        ours, exact = np.array(numbers["toolkit"]), np.array(numbers["exact"])
        for what, rows in (("drag", slice(0, 3)), ("torque", slice(3, 6))):
            error = np.abs(ours / exact - 1)[rows].max()
            checks.append(below(f"{name}: {what}, largest relative error", error, 0.015, gap=GAP_OF_METHOD))
        if "rates" in numbers:
            mine, theirs = (axis_ratio(rates) for rates in numbers["rates"])
            # Of a chain of 4 finer point forces leave the exact ratio, 3.689, where it is: the difference is the method's own.
            gap = GAP_OF_METHOD if name == "chain of 4" else ""
            checks.append(near(f"{name}: equivalent axis ratio", mine, theirs, rel=0.015, gap=gap))
    doublet = found["doublet"]
    ratio = axis_ratio(doublet["rates"][0])
    checks += [
        near("doublet: drag of a sphere along the line (Stimson & Jeffery 1926)", doublet["toolkit"][2] / 2, 0.645, abs=5e-4),
        near("doublet: torque of a sphere about the line, (3/4) zeta(3) (Jeffery 1915)",
             0.75 * doublet["toolkit"][5] / 2, 0.9015, abs=1e-3),
        near("doublet: equivalent axis ratio (Nir & Acrivos 1973)", ratio, 1.982, abs=0.005),
        near("doublet: orbit period", 2 * np.pi * (ratio + 1 / ratio), 15.62, abs=0.03, unit="1/g"),
    ]  # fmt: skip

    def draw():
        figure, axes = canvas(width=4.5, height=2.8)
        places = np.arange(len(found))
        for shift, (what, rows, colour) in zip(
            (-0.18, 0.18), (("drag", slice(0, 3), BLUE), ("torque", slice(3, 6), VERMILION))
        ):
            errors = [100 * (np.array(f["toolkit"]) / np.array(f["exact"]) - 1)[rows] for f in found.values()]
            for k, three in enumerate(errors):
                axes.plot([places[k] + shift] * 3, three, "o" if what == "drag" else "s", ms=4, mfc="none", color=colour,
                          label=what if k == 0 else None)  # fmt: skip
        axes.axhline(0, color="k", lw=0.5)
        axes.set_xticks(places, list(found), rotation=20)
        axes.set(ylabel="toolkit over exact − 1 (%)")
        legend(axes, "one mark for each axis")
        return figure

    return Findings(tuple(checks), draw, "Resistance of touching rigid clusters, toolkit against exact.")


CASE = Case(
    chapter=2,
    claim="Touching spheres held rigidly together have the drag, the torque and the orbits of exact solutions.",
    source="Stimson & Jeffery 1926; Jeffery 1915; Nir & Acrivos 1973 (touching doublet); point forces for more spheres "
    "(own, validation/exact/point_forces.py)",
    tolerance="1.5 %: Stokesian dynamics' own error for three and more spheres (three_spheres_by_point_forces); doublets "
    "to the digits published",
    measure=measure,
    judge=judge,
    parts=parts,
    seen=("strain_sign", "no_lubrication"),
    expected=Verdict.known_gap,
    because="Stokesian dynamics' own error is shown: the drag of a touching square comes out 1.7 % high and that of a "
    "tetrahedron 2.5 %, a chain of 4 turns as a spheroid 2 % too short; doublets are exact, all else is within 1.5 %",
)

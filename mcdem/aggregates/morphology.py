"""Shape and structure of aggregates: one, or a whole population at once.

A population is held ragged, as in a dataset's snapshots: the primaries of all aggregates one after another.

    sizes      : (A,) primaries of each aggregate, P
    positions  : (sum P, 3) [m] centres of the primaries, aggregate after aggregate
    bonds      : (sum B, 2) contacts, numbered from 0 within their own aggregate
    bond_counts: (A,) contacts of each aggregate, n_b

**Inertia-equivalent ellipsoid** (Frungieri & Vanni, Eq. 27): the homogeneous ellipsoid of the aggregate's mass and
principal moments of inertia. Its squared semi-axes are five times the principal second moments of the mass. Two
conventions of "mass":

- ``"points"``: the mass of a primary sits at its centre, as in their R_g (Eq. 25). No semi-axis is taken smaller
  than a primary's radius, so that monomers, doublets, straight chains and planar shapes have a finite ellipsoid.
  This is the convention of their Table 2: over thousands of isostatic packings with the R_g and R of its 19-mer
  (18-mer), the aspect ratio reaches the printed 3.64 (2.90) with points and at most 3.3 (2.8) with solid primaries.
- ``"spheres"``: each primary is a homogeneous sphere and adds its own a^2/5; nothing degenerates.

Primaries of several radii, where given as (sum P,) [m], weigh by their volume, in the centre of mass too.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mcdem.aggregates.rigidity import count_modes

Inertia = Literal["points", "spheres"]
Floats = NDArray[np.float64]
Ints = NDArray[np.integer]


def _per_aggregate(values: Floats, sizes: Ints) -> Floats:
    """Sums over the primaries of each aggregate. values : (sum P, ...) -> (A, ...)"""
    return np.add.reduceat(values, np.concatenate([[0], np.cumsum(sizes)[:-1]]), axis=0)


def _weighted_mean(values: Floats, sizes: Ints, radii: Floats | None) -> Floats:
    """Mean over the mass of each aggregate. values : (sum P, ...) -> (A, ...)"""
    if radii is None:
        return _per_aggregate(values, sizes) / sizes.reshape(-1, *[1] * (values.ndim - 1))
    rest = [1] * (values.ndim - 1)
    masses = radii**3
    return _per_aggregate(masses.reshape(-1, *rest) * values, sizes) / _per_aggregate(masses, sizes).reshape(
        -1, *rest
    )


def about_centres(positions: Floats, sizes: Ints, radii: Floats | None = None) -> Floats:
    """Positions about each aggregate's centre of mass. (sum P, 3) [m]"""
    return positions - np.repeat(_weighted_mean(positions, sizes, radii), sizes, axis=0)


def second_moments(positions: Floats, sizes: Ints, radii: Floats | None = None) -> Floats:
    """Principal second moments of the centres, largest first. (A, 3) [m^2]; they add up to R_g^2."""
    r = about_centres(positions, sizes, radii)
    tensor = _weighted_mean(r[:, :, None] * r[:, None, :], sizes, radii)
    return np.clip(np.linalg.eigvalsh(tensor)[:, ::-1], 0.0, None)


def _largest(values: Floats, sizes: Ints) -> Floats:
    """Largest value in each aggregate. (sum P,) -> (A,)"""
    return np.maximum.reduceat(values, np.concatenate([[0], np.cumsum(sizes)[:-1]]))


def outer_radii(positions: Floats, sizes: Ints, radius: float, radii: Floats | None = None) -> Floats:
    """R, from the centre of mass to the farthest surface. (A,) [m]"""
    distance = np.linalg.norm(about_centres(positions, sizes, radii), axis=1)
    if radii is None:
        return _largest(distance, sizes) + radius
    return _largest(distance + radii, sizes)


def semi_axes(
    moments: Floats,
    radius: float,
    inertia: Inertia = "points",
    sizes: Ints | None = None,
    radii: Floats | None = None,
) -> Floats:
    """Semi-axes of the inertia-equivalent ellipsoid, a_1 >= a_2 >= a_3. (A, 3) [m]

    Of several radii, with the sizes (A,), "points" takes no axis smaller than the largest primary's radius.

    Parameters
    ----------
    moments : (A, 3) [m^2]
        Principal second moments of the centres, largest first.
    radius : float
        Radius of a primary [m].
    inertia : {"points", "spheres"}
        Where the mass of a primary sits.
    sizes : (A,) integers
        Primaries of each aggregate.
    radii : (sum P,) [m]
        Radius of each primary, where there are several.

    Returns
    -------
    (A, 3) array
        [m].

    Examples
    --------
    >>> import numpy as np
    >>> from mcdem.aggregates import semi_axes
    >>> moments = np.array([[2.0e-12, 1.0e-12, 0.5e-12]])

    Points at the centres alone, and with each primary as a sphere:

    >>> semi_axes(moments, 0.5e-6).round(8).tolist()
    [[3.16e-06, 2.24e-06, 1.58e-06]]
    >>> semi_axes(moments, 0.5e-6, inertia="spheres").round(8).tolist()
    [[3.2e-06, 2.29e-06, 1.66e-06]]
    """
    if radii is None or sizes is None:
        floor, own = np.array(radius), np.array(radius**2)
    else:
        floor, own = _largest(radii, sizes)[:, None], _weighted_mean(radii**2, sizes, radii)[:, None]
    if inertia == "spheres":
        return np.sqrt(5.0 * moments + own)
    return np.maximum(np.sqrt(5.0 * moments), floor)


def aspect_ratio(axes: Floats) -> Floats:
    """A.R. = 2 a_1 / (a_2 + a_3), Eq. 27. (A,)

    Parameters
    ----------
    axes : (A, 3) [m]
        Semi-axes, largest first, of `semi_axes`.

    Returns
    -------
    (A,) array
        [-].

    Examples
    --------
    >>> import numpy as np
    >>> from mcdem.aggregates import aspect_ratio
    >>> float(aspect_ratio(np.array([[3e-6, 1e-6, 1e-6]]))[0])
    3.0
    """
    return 2.0 * axes[:, 0] / (axes[:, 1] + axes[:, 2])


def isostatic_bonds(sizes: Ints) -> NDArray[np.int64]:
    """Fewest bonds that can make P primaries rigid: 3P - 6 (Maxwell 1864), and 0, 1 for P = 1, 2. (A,)

    Parameters
    ----------
    sizes : (A,) integers
        Primaries P of each aggregate.

    Returns
    -------
    (A,) integers
        Numbers of bonds.

    Examples
    --------
    >>> import numpy as np
    >>> from mcdem.aggregates import isostatic_bonds
    >>> isostatic_bonds(np.array([1, 2, 3, 4, 20])).tolist()
    [0, 1, 3, 6, 54]
    """
    sizes = np.asarray(sizes, dtype=np.int64)
    return np.maximum(3 * sizes - 6, sizes - 1) * (sizes > 0)


VARIABLES: dict[str, tuple[str, str]] = {
    "size": ("1", "number of primaries P"),
    "outer_radius": ("m", "outer radius R"),
    "radius_of_gyration": ("m", "radius of gyration R_g (Eq. 25)"),
    "aspect_ratio": ("1", "aspect ratio of the inertia-equivalent ellipsoid (Eq. 27)"),
    "solid_fraction_sphere": ("1", "solid fraction of the sphere of radius R"),
    "solid_fraction_ellipsoid": ("1", "solid fraction of the inertia-equivalent ellipsoid"),
    "bond_count": ("1", "number of bonds n_b"),
    "coordination_number": ("1", "mean coordination number 2 n_b / P"),
    "isostatic_bond_count": ("1", "bonds needed for rigidity, 3P - 6"),
    "floppy_modes": ("1", "independent motions that stretch no bond"),
    "redundant_bonds": ("1", "bonds beyond those that are independent"),
}


def population_morphology(
    positions: Floats,
    sizes: Ints,
    bonds: Ints,
    bond_counts: Ints,
    radius: float,
    inertia: Inertia = "points",
    rigidity: bool = True,
    radii: Floats | None = None,
) -> xr.Dataset:
    """Shape and structure of every aggregate of a population; shapes as in the head of this file.

    Parameters
    ----------
    positions : (sum P, 3) [m]
        Centres of the primaries, aggregate after aggregate.
    sizes, bond_counts : (A,) integers
        Primaries and contacts of each aggregate.
    bonds : (sum B, 2) integers
        Contacts, numbered from 0 within their own aggregate.
    radius : float
        Of a primary [m], of several the largest.
    inertia : {"points", "spheres"}
        Where the mass of a primary sits.
    rigidity : bool
        Whether to count floppy modes and redundant bonds, by far the dearest of all.
    radii : (sum P,) [m]
        Of each primary, where there are several.

    Returns
    -------
    xarray.Dataset
        Over ``aggregate``; its variables carry units and long names.

    Examples
    --------
    >>> import mcdem
    >>> from mcdem.aggregates import population_morphology
    >>> import numpy as np
    >>> doublet, chain = np.array([[-1, 0, 0], [1, 0, 0]]), np.array([[-2, 0, 0], [0, 0, 0], [2, 0, 0]])
    >>> positions = 0.5e-6 * np.concatenate([doublet, chain])
    >>> bonds = np.array([[0, 1], [0, 1], [1, 2]])
    >>> found = population_morphology(positions, np.array([2, 3]), bonds, np.array([1, 2]), 0.5e-6)
    >>> found["radius_of_gyration"].values.round(9).tolist()
    [5e-07, 8.16e-07]
    """
    sizes = np.asarray(sizes, dtype=np.int64)
    bond_counts = np.asarray(bond_counts, dtype=np.int64)
    positions = np.asarray(positions, dtype=np.float64).reshape(-1, 3)
    bonds = np.asarray(bonds, dtype=np.int64).reshape(-1, 2)
    if sizes.sum() != len(positions) or bond_counts.sum() != len(bonds) or len(sizes) != len(bond_counts):
        raise ValueError(
            f"ragged population does not add up: {sizes.sum()} primaries of {len(sizes)} aggregates against "
            f"{len(positions)} positions, {bond_counts.sum()} bonds of {len(bond_counts)} against {len(bonds)}"
        )
    if len(sizes) and sizes.min() < 1:
        raise ValueError(f"aggregate {int(np.argmin(sizes))} has no primaries")

    modes: NDArray[np.int64] | None
    if len(sizes) == 0:
        moments, outer, modes = np.empty((0, 3)), np.empty(0), np.empty((0, 2), dtype=np.int64)
    else:
        moments = second_moments(positions, sizes, radii)
        outer = outer_radii(positions, sizes, radius, radii)
        modes = count_modes(positions / radius, sizes, bonds, bond_counts) if rigidity else None
    axes = semi_axes(moments, radius, inertia, sizes, radii)
    cubes = sizes * radius**3 if radii is None or len(sizes) == 0 else _per_aggregate(radii**3, sizes)
    values = {
        "size": sizes,
        "outer_radius": outer,
        "radius_of_gyration": np.sqrt(moments.sum(axis=1)),
        "aspect_ratio": aspect_ratio(axes),
        "solid_fraction_sphere": sizes * (radius / outer) ** 3 if radii is None else cubes / outer**3,
        "solid_fraction_ellipsoid": cubes / axes.prod(axis=1),
        "bond_count": bond_counts,
        "coordination_number": 2.0 * bond_counts / sizes,
        "isostatic_bond_count": isostatic_bonds(sizes),
    }
    if modes is not None:
        values |= {"floppy_modes": modes[:, 0], "redundant_bonds": modes[:, 1]}
    dataset = xr.Dataset(
        {
            name: ("aggregate", value, {"units": VARIABLES[name][0], "long_name": VARIABLES[name][1]})
            for name, value in values.items()
        },
        attrs={"primary_radius": radius, "inertia": inertia},
    )
    dataset["semi_axes"] = (
        ("aggregate", "axis"),
        axes,
        {"units": "m", "long_name": "semi-axes of the inertia-equivalent ellipsoid, largest first"},
    )
    return dataset


def morphology(
    positions: Floats, bonds: Ints, radius: float, inertia: Inertia = "points", radii: Floats | None = None
) -> xr.Dataset:
    """Shape and structure of one aggregate: positions (P, 3) [m], bonds (n_b, 2). Scalars with units.

    Parameters
    ----------
    positions : (P, 3) [m]
        Centres of the primaries.
    bonds : (n_b, 2) integers
        Contacts.
    radius : float
        Of a primary [m].
    inertia : {"points", "spheres"}
        Where the mass of a primary sits.
    radii : (P,) [m]
        Of each primary, where there are several.

    Returns
    -------
    xarray.Dataset
        Scalars with units and long names.

    Examples
    --------
    >>> import numpy as np
    >>> from mcdem.aggregates import morphology
    >>> line = np.array([[-2e-6, 0, 0], [-1e-6, 0, 0], [0, 0, 0], [1e-6, 0, 0], [2e-6, 0, 0]])
    >>> bonds = np.array([[0, 1], [1, 2], [2, 3], [3, 4]])
    >>> found = morphology(line, bonds, 0.5e-6)
    >>> round(float(found.outer_radius), 9), round(float(found.radius_of_gyration), 9)
    (2.5e-06, 1.414e-06)
    """
    positions = np.asarray(positions, dtype=np.float64).reshape(-1, 3)
    bonds = np.asarray(bonds, dtype=np.int64).reshape(-1, 2)
    one = population_morphology(
        positions, np.array([len(positions)]), bonds, np.array([len(bonds)]), radius, inertia, True, radii
    )
    return one.isel(aggregate=0)

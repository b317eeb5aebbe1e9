"""The course of one encounter: kept in memory, written and read as NetCDF in the AMBER convention, exported.

The file follows AMBER's NetCDF trajectory convention 1.0 (https://ambermd.org/netcdf/nctraj.xhtml): classic NetCDF,
`coordinates` in angstrom, `time` in picosecond. Beyond it, every primary carries `radius`, `parent` (0 for i, 1 for j),
`coordination_number` and `largest_tension`, so that OVITO colours by them, and every frame its bonds with their
tensions, so that nothing of the encounter is lost: `read` returns what `write` was given.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mcdem.errors import DataFileError, UserError
from mcdem.netcdf.whole_files import CLASSIC, FILES, TRAJECTORY, VTK, XYZ

if TYPE_CHECKING:
    from mcdem.encounter.simulate import EncounterResult, Recorder
    from mcdem.scene import Scene

ANGSTROM, PICOSECOND = 1e-10, 1e-12
NO_BOND = -1


@dataclass(frozen=True, eq=False)
class Trajectory:
    """What a film, a view or an analysis needs of an encounter; SI throughout.

    radius : of the primaries [m], of several the largest;  shear_rate : [1/s]
    pull_off_force : of a contact [N] of two such primaries, nan without contacts
    time : (F,) [s];  positions : (F, N, 3) [m]
    tension : (F, N, N) [N] of each bond, symmetric, nan where there is no bond; compression is negative
    parent : (N,) 0 for primaries of aggregate i, 1 for those of j
    origin : what made it: scene text, outcome, seed, ...
    radii : (N,) [m] of primaries of several radii, else None

    Examples
    --------
    >>> import numpy as np
    >>> from mcdem.encounter import Trajectory
    >>> time, parent = np.array([0.0, 1e-4]), np.array([0, 1])
    >>> positions = 1e-6 * np.array([[[0, 0, 0], [0, 1, -4]], [[0, 0, 0], [0, 1, 4]]])
    >>> no_bond = np.full((2, 2, 2), np.nan)
    >>> passage = Trajectory(0.5e-6, 1e4, np.nan, time, positions, no_bond, parent)
    >>> passage.positions.shape
    (2, 2, 3)
    """

    radius: float
    shear_rate: float
    pull_off_force: float
    time: NDArray[np.float64]
    positions: NDArray[np.float64]
    tension: NDArray[np.float64]
    parent: NDArray[np.integer]
    origin: dict[str, str] = field(default_factory=dict)
    radii: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        frames, primaries = self.positions.shape[:2]
        for name, expected in (
            ("time", (frames,)),
            ("positions", (frames, primaries, 3)),
            ("tension", (frames, primaries, primaries)),
            ("parent", (primaries,)),
        ):
            if getattr(self, name).shape != expected:
                raise ValueError(f"{name} has shape {getattr(self, name).shape}, expected {expected}")

    @classmethod
    def of_encounter(
        cls, scene: Scene, recorder: Recorder, result: EncounterResult | None = None, **origin: str
    ) -> Self:
        """The course that `simulate_encounter(..., record=recorder)` kept."""
        contact, radius = scene.effects.contact, scene.suspension.radius
        if result is not None:
            origin = {"outcome": result.outcome, **origin}
        return cls(
            radius,
            scene.flow.shear_rate,
            np.nan if contact is None else contact.pull_off_force(radius),
            recorder.time,
            recorder.positions,
            recorder.tension,
            recorder.parent,
            {"scene": scene.text, **origin},
            recorder.radii,
        )

    @property
    def frames(self) -> int:
        return len(self.time)

    @property
    def each_radius(self) -> NDArray[np.float64]:
        """(N,) [m] radius of each primary."""
        return np.full(len(self.parent), self.radius) if self.radii is None else self.radii

    @property
    def strain(self) -> NDArray[np.float64]:
        """(F,) g t"""
        return self.shear_rate * self.time

    def bonds(self, frame: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Bonds (B, 2), i < j, of a frame and their tensions (B,) [N]."""
        pairs = np.argwhere(np.triu(np.isfinite(self.tension[frame]), 1))
        return pairs, self.tension[frame][pairs[:, 0], pairs[:, 1]]

    @property
    def coordination_number(self) -> NDArray[np.int64]:
        """(F, N) bonds of each primary."""
        return np.asarray(np.isfinite(self.tension).sum(axis=2))

    @property
    def largest_tension(self) -> NDArray[np.float64]:
        """(F, N) [N] of the bonds of each primary; 0 where nothing pulls."""
        return np.asarray(np.nan_to_num(self.tension, nan=-np.inf).max(axis=2, initial=0.0))

    def part(self, first: int, last: int, every: int = 1) -> Trajectory:
        """Frames first, first + every, ... before last."""
        chosen = slice(first, last, every)
        return Trajectory(
            self.radius,
            self.shear_rate,
            self.pull_off_force,
            self.time[chosen],
            self.positions[chosen],
            self.tension[chosen],
            self.parent,
            self.origin,
            self.radii,
        )

    def to_xarray(self) -> xr.Dataset:
        """SI arrays over ``frame``, ``primary``, ``axis``."""

        def quantity(
            dims: tuple[str, ...], values: Any, units: str, long_name: str
        ) -> tuple[tuple[str, ...], Any, dict[str, str]]:
            return dims, values, {"units": units, "long_name": long_name}

        return xr.Dataset(
            {
                "position": quantity(
                    ("frame", "primary", "axis"), self.positions, "m", "centres of the primaries"
                ),
                "tension": quantity(
                    ("frame", "primary", "other"), self.tension, "N", "tension of bonds, nan: none"
                ),
                "coordination_number": quantity(("frame", "primary"), self.coordination_number, "1", "bonds"),
                "parent": quantity(("primary",), self.parent, "1", "0: aggregate i, 1: aggregate j"),
            },
            {
                "time": quantity(("frame",), self.time, "s", "time"),
                "strain": quantity(("frame",), self.strain, "1", "g t"),
            },
            {
                "radius": self.radius,
                "shear_rate": self.shear_rate,
                "pull_off_force": self.pull_off_force,
                **self.origin,
            },
        )


def write(trajectory: Trajectory, path: Path | str) -> None:
    """Write an AMBER NetCDF trajectory with the extra fields."""
    t = trajectory
    frames = t.frames
    bonds = [t.bonds(k) for k in range(frames)]
    # One at least: a dimension of length 0 would read as the unlimited one.
    slots = max(1, *(len(tension) for _, tension in bonds))
    pairs = np.full((frames, slots, 2), NO_BOND, dtype=np.int32)
    pull = np.full((frames, slots), np.nan)
    for k, (pair, tension) in enumerate(bonds):
        pairs[k, : len(pair)], pull[k, : len(tension)] = pair, tension
    every = np.ones((frames, 1))
    data = xr.Dataset(
        {
            "spatial": ("spatial", np.array([b"x", b"y", b"z"], "S1")),
            "time": ("frame", t.time / PICOSECOND, {"units": "picosecond"}),
            "coordinates": (("frame", "atom", "spatial"), t.positions / ANGSTROM, {"units": "angstrom"}),
            "radius": (("frame", "atom"), every * t.each_radius / ANGSTROM, {"units": "angstrom"}),
            "parent": (
                ("frame", "atom"),
                (every * t.parent).astype(np.int32),
                {"long_name": "0: aggregate i, 1: j"},
            ),
            "coordination_number": (
                ("frame", "atom"),
                t.coordination_number.astype(np.int32),
                {"units": "1"},
            ),
            "largest_tension": (
                ("frame", "atom"),
                t.largest_tension,
                {"units": "newton", "long_name": "largest tension of the primary's bonds"},
            ),
            "bond": (
                ("frame", "bond_slot", "bond_end"),
                pairs,
                {"long_name": "primaries in contact, -1: unused"},
            ),
            "bond_tension": (("frame", "bond_slot"), pull, {"units": "newton"}),
        },
        attrs={
            "title": "encounter of two aggregates in shear",
            "Conventions": "AMBER",
            "ConventionVersion": "1.0",
            "program": "mcdem",
            "programVersion": "1",
            "primary_radius": t.radius,
            "shear_rate": t.shear_rate,
            "pull_off_force": t.pull_off_force,
            **t.origin,
        },
    )
    FILES.write_dataset(
        path,
        TRAJECTORY,
        {"": data},
        format="NETCDF3_64BIT",
        engine="scipy",
        unlimited_dims=["frame"],
    )


def is_trajectory(path: Path | str) -> bool:
    """Whether a file is a NetCDF trajectory in the AMBER convention."""
    try:
        if not Path(path).is_file():
            return False
        with Path(path).open("rb") as file:
            header = file.read(1 << 16)
    except (OSError, ValueError):
        return False
    return header.startswith(CLASSIC) and b"AMBER" in header


EXPECTED = "what `mcdem encounter --trajectory` writes"
OURS = {"scene", "outcome", "offset", "seed", "command", "source"}


def read(path: Path | str) -> Trajectory:
    """The trajectory that `write` wrote; raises `DataFileError` for any other file.

    Parameters
    ----------
    path : path
        File of `mcdem encounter --trajectory`, or of `export`.

    Returns
    -------
    Trajectory
        In SI units.

    Raises
    ------
    DataFileError
        Of any other file.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from mcdem.encounter import Trajectory, export, read
    >>> positions = 1e-6 * np.array([[[0, 0, 0], [0, 1, -4]], [[0, 0, 0], [0, 1, 4]]])
    >>> passage = Trajectory(
    ...     0.5e-6, 1e4, np.nan, np.array([0.0, 1e-4]), positions, np.full((2, 2, 2), np.nan), np.array([0, 1])
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export(passage, Path(folder) / "passage.nc")
    ...     again = read(Path(folder) / "passage.nc")
    >>> np.allclose(again.positions, positions)
    True
    """
    with FILES.reading(path, EXPECTED):
        with xr.open_dataset(path, decode_times=False, mask_and_scale=False) as opened:
            data = opened.load()
        if data.attrs.get("Conventions") != "AMBER" or "bond_tension" not in data:
            raise DataFileError(f"{path}: not an encounter's trajectory; expected {EXPECTED}")
        positions, radii = data["coordinates"].values * ANGSTROM, data["radius"].values[0] * ANGSTROM
        frames, atoms = positions.shape[:2]
        tension = np.full((frames, atoms, atoms), np.nan)
        frame, slot = np.nonzero(data["bond"].values[..., 0] != NO_BOND)
        i, j = data["bond"].values[frame, slot].T
        tension[frame, i, j] = tension[frame, j, i] = data["bond_tension"].values[frame, slot]
        return Trajectory(
            float(data.attrs["primary_radius"]),
            float(data.attrs["shear_rate"]),
            float(data.attrs["pull_off_force"]),
            data["time"].values * PICOSECOND,
            positions,
            tension,
            data["parent"].values[0].astype(np.int64),
            {name: str(value) for name, value in data.attrs.items() if name in OURS},
            None if np.allclose(radii, float(data.attrs["primary_radius"]), rtol=1e-9, atol=0.0) else radii,
        )
    raise AssertionError  # the guard lets nothing pass in silence


# Other formats


def write_extended_xyz(trajectory: Trajectory, path: Path | str) -> None:
    """Extended XYZ, lengths in angstrom: parent, coordination and largest tension [nN] of every primary, a frame each."""
    t = trajectory
    columns = "species:S:1:pos:R:3:radius:R:1:parent:I:1:coordination_number:I:1:largest_tension_nN:R:1"
    with FILES.replacing(path, XYZ) as beside, beside.open("w", encoding="utf-8") as file:
        for k in range(t.frames):
            file.write(f"{len(t.parent)}\n")
            file.write(f'Properties={columns} Time={t.time[k]:.9e} Strain={t.strain[k]:.6f} pbc="F F F"\n')
            for n, (x, y, z) in enumerate(t.positions[k] / ANGSTROM):
                file.write(
                    f"X {x:.8e} {y:.8e} {z:.8e} {t.each_radius[n] / ANGSTROM:.8e} {t.parent[n]} "
                    f"{t.coordination_number[k, n]} {1e9 * t.largest_tension[k, n]:.6e}\n"
                )


def write_vtk(trajectory: Trajectory, directory: Path | str) -> list[Path]:
    """One legacy VTK file a frame, for ParaView: primaries as points, bonds as lines, lengths in micrometres.

    Point data: radius, parent, coordination_number; cell data: tension [nN] (vertices carry 0).  The frames that the folder holds
    go, when all of these are written.
    """
    t = trajectory
    digits = max(4, len(str(t.frames)))

    def text(k: int) -> str:
        pairs, tension = t.bonds(k)
        atoms = len(t.parent)
        lines = [
            "# vtk DataFile Version 3.0",
            f"encounter, strain {t.strain[k]:.6f}",
            "ASCII",
            "DATASET UNSTRUCTURED_GRID",
            f"POINTS {atoms} double",
            *(f"{x:.9e} {y:.9e} {z:.9e}" for x, y, z in 1e6 * t.positions[k]),
            f"CELLS {atoms + len(pairs)} {2 * atoms + 3 * len(pairs)}",
            *(f"1 {n}" for n in range(atoms)),
            *(f"2 {i} {j}" for i, j in pairs),
            f"CELL_TYPES {atoms + len(pairs)}",
            *["1"] * atoms,
            *["3"] * len(pairs),
            f"CELL_DATA {atoms + len(pairs)}",
            "SCALARS tension_nN double 1",
            "LOOKUP_TABLE default",
            *["0"] * atoms,
            *(f"{1e9 * f:.6e}" for f in tension),
            f"POINT_DATA {atoms}",
        ]
        for name, kind, values in (
            ("radius_um", "double", [f"{1e6 * r:.9e}" for r in t.each_radius]),
            ("parent", "int", t.parent),
            ("coordination_number", "int", t.coordination_number[k]),
        ):
            lines += [f"SCALARS {name} {kind} 1", "LOOKUP_TABLE default", *(str(v) for v in values)]
        return "\n".join(lines) + "\n"

    names = [f"frame_{k:0{digits}d}.vtk" for k in range(t.frames)]
    with FILES.filling(directory, VTK, FRAMES) as beside:
        for k, name in enumerate(names):
            (beside / name).write_text(text(k), encoding="ascii")
    return [Path(directory) / name for name in names]


FRAMES = "frame_[0-9]*.vtk"
"""Files of a folder that are frames."""


def check(path: Path | str, *, overwrite: bool = True) -> None:
    """Raise `UserError` where no trajectory of this name may be written."""
    path = Path(path)
    _writer(path)
    kind = {".nc": TRAJECTORY, ".xyz": XYZ, ".extxyz": XYZ}.get(path.suffix.lower())
    if kind is not None:
        FILES.check(path, kind, overwrite=overwrite)
        return
    if path.exists() and not path.is_dir():
        raise DataFileError(f"{path}: a file, expected a folder's name for VTK files")
    for file in sorted(path.glob(FRAMES)):
        FILES.check(file, VTK, overwrite=overwrite)


def export(trajectory: Trajectory, path: Path | str) -> None:
    """Write in the format that the name asks for: .nc, .xyz, or a folder of VTK files; raises `UserError`.

    Parameters
    ----------
    trajectory : Trajectory
        Of a `Recorder`, or of `read`.
    path : path
        Ends in .nc (AMBER), in .xyz (extended XYZ), or is a folder (VTK).

    Raises
    ------
    UserError
        Where no trajectory of this name may be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from mcdem.encounter import Trajectory, export
    >>> positions = 1e-6 * np.array([[[0, 0, 0], [0, 1, -4]], [[0, 0, 0], [0, 1, 4]]])
    >>> passage = Trajectory(
    ...     0.5e-6, 1e4, np.nan, np.array([0.0, 1e-4]), positions, np.full((2, 2, 2), np.nan), np.array([0, 1])
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export(passage, Path(folder) / "passage.xyz")
    ...     print((Path(folder) / "passage.xyz").read_text().splitlines()[0])
    2
    """
    path = Path(path)
    check(path)
    _writer(path)(trajectory, path)


def _writer(path: Path) -> Callable[[Trajectory, Path], Any]:
    writers: dict[str, Callable[[Trajectory, Path], Any]] = {
        ".nc": write,
        ".xyz": write_extended_xyz,
        ".extxyz": write_extended_xyz,
        "": write_vtk,
        ".vtk": write_vtk,
    }
    if path.suffix.lower() not in writers:
        raise UserError(f"{path}: expected a name that ends in .nc or .xyz, or a folder's name for VTK files")
    return writers[path.suffix.lower()]

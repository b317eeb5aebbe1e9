"""What pbekit writes and reads: the kinds of its files, and the one way to them (`pbekit.files`)."""

from __future__ import annotations

from pathlib import Path

from pbekit.errors import PBEError
from pbekit.files import HDF5, Files, Kind

FILES = Files("pbekit", PBEError)
"""Every file of pbekit is written and read through this."""

TABLE = Kind(
    "kernel table", (HDF5,), (b"Outcomes of encounters of colloidal aggregates, by class",), sealed=True
)
ATLAS = Kind("atlas of encounters", (HDF5,), (b"Atlas of encounters of colloidal aggregates",), sealed=True)
SOLUTION = Kind(
    "solution of `pbekit solve`",
    (HDF5,),
    (b"Course of a population balance", b"extrapolated_flux"),
    sealed=True,
)


def check_solution(path: Path, *, overwrite: bool) -> None:
    """Refuse a name that says another format than NetCDF, and a place where no solution may be written."""
    if path.suffix != ".nc":
        raise PBEError(
            f"{path}: expected a name that ends in .nc, what is written is NetCDF; a table of text comes from it by "
            "xarray.open_dataset(FILE).mean_size.to_dataframe().to_csv(...)"
        )
    FILES.check(path, SOLUTION, overwrite=overwrite)

"""What pbekit writes and reads: the kinds of its files, and the one way to them (`pbekit.files`)."""

from __future__ import annotations

from pbekit.errors import PBEError
from pbekit.files import HDF5, Files, Kind

FILES = Files("pbekit", PBEError)
"""Every file of pbekit is written and read through this."""

TABLE = Kind(
    "kernel table", (HDF5,), (b"Outcomes of encounters of colloidal aggregates, by class",), sealed=True
)
SOLUTION = Kind(
    "solution of `pbekit solve`",
    (HDF5,),
    (b"Course of a population balance", b"extrapolated_flux"),
    sealed=True,
)

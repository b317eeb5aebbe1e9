"""The targets, one file each; a new one is its file and its name here."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from pbekit.arguments import shown
from pbekit.errors import PBEError

if TYPE_CHECKING:  # a command's help names the targets, without their machinery
    from pbekit.export.target import Target

TARGETS = (
    "csv",
    "matlab",
    "openfoam",
    "openqbmm",
    "pysdm",
    "particula",
    "dustpy",
)


def target(name: str) -> Target:
    """The target of this name; raises `PBEError`."""
    if name not in TARGETS:
        raise PBEError(f"--to {shown(name)}: no target of an export, expected one of {', '.join(TARGETS)}")
    found: Target = import_module(f"pbekit.export.to_{name}").TARGET
    return found

"""Errors that are the user's to mend: each message names the place, what stands there and the cure.

The command line prints them on one line and exits with code 2; everything else is a defect of the program and
keeps its traceback.
"""

from __future__ import annotations


class UserError(Exception):
    """Something the user gave cannot be used."""


class SceneError(UserError):
    """A scene (its file, a table, a key or a value) cannot be used."""


class DataFileError(UserError):
    """A dataset cannot be read, is not ours, or would be overwritten."""


class MachineWarning(UserWarning):
    """Encounters of one dataset are computed on machines that round differently."""

"""The version of both packages, which are one distribution."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("pbekit")
except PackageNotFoundError:
    __version__ = "of a folder"

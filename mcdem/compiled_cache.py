"""Keep numba's cache on disk honest.

numba notices an edit of the file in which a kernel is defined, not an edit of a kernel that it calls, of a constant that it
reads or of a named tuple that it is given from another file, and would go on running the old one.  So the cache folder is
named by a hash of every source file on which compiled code depends: those that compile, all that these import, and
those that define a named tuple.  A `NUMBA_CACHE_DIR` set by the user, as on clusters, holds that folder.

It is asked for whenever the package is imported, so it loads nothing and finds imports by their lines alone.  Effects of other
packages are compiled into ours: their files count too.
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path

_TYPES_ONLY = re.compile(rb"^if TYPE_CHECKING:\n(?:[ \t]+[^\n]*\n|[ \t]*\n)+", re.MULTILINE)
_IMPORT = re.compile(
    rb"^[ \t]*(?:from[ \t]+([.\w]+)[ \t]+import[ \t]+(\([^)]*\)|(?:[^\n\\]|\\\n)*)|import[ \t]+((?:[^\n\\]|\\\n)*))",
    re.MULTILINE,
)


def key_by_sources(package: Path) -> Path:
    """Point numba at a cache folder that belongs to exactly these sources, within the user's if there is one; returns it.

    The folder goes into the environment unless numba is loaded already.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        root = Path(given)
        if re.fullmatch(rf"{package.name}-[0-9a-f]{{16}}", root.name):  # inherited from another process
            root = root.parent
    else:
        root = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / package.name
    folder = root / f"{package.name}-{digest(package)}"
    if "numba" in sys.modules:
        # A change of the environment would make it read all of that again, over what was set since.
        sys.modules["numba"].config.CACHE_DIR = str(folder)
    else:
        os.environ["NUMBA_CACHE_DIR"] = str(folder)
    return folder


def digest(package: Path) -> str:
    """Changes with every source file of the package (names and contents) on which compiled code depends."""
    found = hashlib.sha256()
    for path, text in sorted(sources(package).items()):
        found.update(f"{path.relative_to(package).as_posix()} {len(text)}\n".encode())
        found.update(text)
    for path in sources_of_others():
        text = path.read_bytes()
        found.update(f"{path.name} {len(text)}\n".encode())
        found.update(text)
    return found.hexdigest()[:16]


def sources_of_others(group: str = "mcdem.effects") -> list[Path]:
    """The files of modules of other packages, or all of the packages, that give effects by an entry point."""
    files: list[Path] = []
    for module in sorted({entry.module for entry in entry_points(group=group)}):
        spec = find_spec(module.partition(".")[0])
        for folder in (spec and spec.submodule_search_locations) or ():
            files += sorted(Path(folder).rglob("*.py"))
        if spec is not None and spec.submodule_search_locations is None and spec.origin:
            files.append(Path(spec.origin))
    return files


def sources(package: Path) -> dict[Path, bytes]:
    """The source files of the package on which compiled code depends."""
    texts = {path: path.read_bytes() for path in package.rglob("*.py")}
    named = {_module_of(path, package): path for path in texts}
    reached = {path for path, text in texts.items() if b"NamedTuple" in text or b"namedtuple" in text}
    compiles = {"numba", f"{package.name}.compilation"}
    imports: dict[Path, set[str]] = {}
    waiting = []
    for path, text in texts.items():
        if b"numba" in text or b"compilation" in text:
            imports[path] = imported(text, path, package)
            if any(
                name in compiles or name.startswith(("numba.", f"{package.name}.compilation."))
                for name in imports[path]
            ):
                waiting.append(path)
    followed = set()
    while waiting:
        path = waiting.pop()
        if path in followed:
            continue
        followed.add(path)
        names = imports.get(path) or imported(texts[path], path, package)
        waiting += [named[name] for name in names if name in named]
    return {path: texts[path] for path in reached | followed}


def _module_of(path: Path, package: Path) -> str:
    """The name by which a source file is imported."""
    inside = path.parts[len(package.parts) - 1 :]
    return ".".join(inside[:-1] if inside[-1] == "__init__.py" else (*inside[:-1], inside[-1][:-3]))


def imported(text: bytes, path: Path, package: Path) -> set[str]:
    """Names of modules, and of what may be one, that a source file imports, but for those of types alone."""
    inside = (package.name, *path.relative_to(package).parent.parts)
    names = set()
    if b"TYPE_CHECKING" in text:
        text = _TYPES_ONLY.sub(b"", text)
    for origin, members, modules in _IMPORT.findall(text):
        if modules:
            names |= {words.split()[0] for part in modules.decode().split(",") if (words := _plain(part))}
            continue
        module = origin.decode().lstrip(".")
        level = len(origin) - len(module)
        start = ".".join(inside[: len(inside) - level + 1]) if level else ""
        module = ".".join(part for part in (start, module) if part)
        names.add(module)
        inner = re.sub(r"#[^\n]*", "", members.decode()).strip("() \t\r\n").split(",")
        names |= {f"{module}.{words.split()[0]}" for part in inner if (words := _plain(part))}
    return names


def _plain(part: str) -> str:
    """A name and perhaps its alias, without comment and broken lines."""
    return part.partition("#")[0].replace("\\", " ").strip()

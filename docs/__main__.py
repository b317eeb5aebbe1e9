"""Build the manual: `python -m docs` writes build/manual/index.html; any warning ends it with exit code 1.

Needs `pip install 'pbekit[docs]'`.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from pathlib import Path

DOCS = Path(__file__).parent
ROOT = DOCS.parent
INCLUDED = ("CITATION.cff", "mcdem/effects/born.py")
"""Files of the repository that pages include, from `included/`."""
PAGES = {".md", ".toml", ".rst", ".css", ".svg", ".png", ".gif", ".sbatch"}


def gather(target: Path, gallery: bool) -> None:
    """The pages, and the notebooks with their output, in one folder that holds nothing else."""
    wanted = {}
    for path in DOCS.rglob("*"):
        if path.suffix in PAGES and path.is_file():
            wanted[target / path.relative_to(DOCS)] = path
    for name in INCLUDED:
        wanted[target / "included" / Path(name).name] = ROOT / name
    if gallery:
        from docs.notebooks import all_executed

        for name in ("README.md", "make.sh"):
            wanted[target / "gallery/data" / name] = ROOT / "notebooks/data" / name
        for path, with_output in all_executed().items():
            wanted[target / "gallery" / path.name] = with_output
    from docs.extensions.reference import packages

    made = {target / "reference" / f"{package}.rst": page_of(package) for package in packages()}
    for path in list(target.rglob("*")):
        if path in made:
            continue
        if path.is_file() and path not in wanted and "pictures" not in path.parts:
            path.unlink()
    for place, path in wanted.items():
        place.parent.mkdir(parents=True, exist_ok=True)
        if not place.exists() or place.read_bytes() != path.read_bytes():
            shutil.copy(path, place)
    for place, text in made.items():
        if not place.exists() or place.read_text(encoding="utf-8") != text:
            place.write_text(text, encoding="utf-8")


def page_of(package: str) -> str:
    """The page of a package in the reference."""
    title = f"``{package}``"
    return f"{title}\n{'=' * len(title)}\n\n.. automodule:: {package}\n    :no-members:\n\n.. public:: {package}\n"


def main() -> int:
    """Gather and build."""
    parser = argparse.ArgumentParser(prog="python -m docs", description="Build the manual.")
    parser.add_argument(
        "-o", "--output", type=Path, default=ROOT / "build/manual", help="default: build/manual"
    )
    parser.add_argument("--record", action="store_true", help="run recorded console blocks anew")
    parser.add_argument("--fresh", action="store_true", help="build every page anew")
    parser.add_argument(
        "--without-notebooks", action="store_true", help="leave the notebooks out of the gallery"
    )
    given = parser.parse_args()
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
    os.environ["MANUAL_ROOT"] = str(ROOT)
    sys.path.insert(0, str(ROOT))
    if given.record:
        os.environ["MANUAL_RECORD"] = "1"
    if given.without_notebooks:
        os.environ["MANUAL_WITHOUT_NOTEBOOKS"] = "1"
    from sphinx.cmd.build import build_main

    output = given.output.resolve()
    sources = output.parent / "manual-sources"
    work = output.parent / "manual-work"
    shutil.rmtree(work, ignore_errors=True)
    gather(sources, not given.without_notebooks)
    options = [
        "-b",
        "html",
        "-c",
        str(DOCS),
        "-d",
        str(output.parent / "manual-doctrees"),
        "-W",
        "--keep-going",
        "-q",
    ]
    if given.fresh or given.record:
        options += ["-E", "-a"]
    code = build_main([*options, str(sources), str(output)])
    shutil.rmtree(work, ignore_errors=True)
    print(f"{output / 'index.html'}" if code == 0 else "the manual has errors", flush=True)
    return int(code)


if __name__ == "__main__":
    sys.exit(main())

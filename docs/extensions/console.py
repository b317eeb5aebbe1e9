"""Console blocks that are run when the manual is built, and shown with what they print.

    ```{console}
    $ mcdem check scenes/paper-1000Pa.toml
    ```

Each page has a folder of its own, which begins with the repository's `scenes` and `notebooks/data`; what one block writes the
next one finds.  A command that ends otherwise than `:exit:` says (0) ends the build.

    :recorded:   what it prints is kept in `docs/recorded`, since it takes long; `python -m docs --record` makes it anew
    :show: 12    this many lines, then an ellipsis
    :figure:     a picture that was written, shown below, of a recorded block that in `docs`; `:alt:` says what it shows

`{python}` does the same for Python: blocks of a page share their names, and what they print is shown below.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import re
import shutil
import subprocess
import sys
import traceback
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).parents[2]
RECORDED = ROOT / "docs/recorded"
COLUMNS = 84
logger = logging.getLogger(__name__)


def folder_of(work: Path, page: str) -> Path:
    """The folder in which the blocks of a page run."""
    folder = work / page.replace("/", "-")
    if not folder.exists():
        folder.mkdir(parents=True)
        shutil.copytree(ROOT / "scenes", folder / "scenes")
        for example in (ROOT / "docs/howto/examples").glob("*.toml"):
            shutil.copy(example, folder / "scenes")
        (folder / "notebooks").mkdir()
        (folder / "notebooks/data").symlink_to(ROOT / "notebooks/data")
    return folder


def environment(work: Path) -> dict[str, str]:
    """What commands see: the programs of this checkout, a screen of fixed width, one thread of linear algebra."""
    bin_folder = work / "bin"
    bin_folder.mkdir(parents=True, exist_ok=True)
    for program in ("mcdem", "pbekit"):
        script = bin_folder / program
        script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m {program} "$@"\n', encoding="utf-8")
        script.chmod(0o755)
    return {
        **os.environ,
        "PATH": f"{bin_folder}:{Path(sys.executable).parent}:{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "COLUMNS": str(COLUMNS),
        "NO_COLOR": "1",
        "TERM": "dumb",
    }


def run(command: str, folder: Path, work: Path) -> tuple[int, str]:
    """(exit code, output) of a command; its warnings and errors too, but not its progress."""
    done = subprocess.run(
        ["bash", "-c", command], cwd=folder, env=environment(work), text=True, timeout=900,
        capture_output=True, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    said = [
        line for line in done.stderr.splitlines() if done.returncode or line.startswith(("warning:", "note:"))
    ]
    return done.returncode, "\n".join(line.rstrip() for line in [*said, *done.stdout.rstrip().splitlines()])


def record_of(page: str, text: str) -> Path:
    """Where the output of a recorded block is kept."""
    name = hashlib.sha256(text.encode()).hexdigest()[:12]
    return RECORDED / f"{page.replace('/', '-')}-{name}.txt"


class Console(SphinxDirective):
    """`{console}`."""

    has_content = True
    option_spec: ClassVar[dict[str, Any]] = {
        "recorded": directives.flag,
        "exit": directives.nonnegative_int,
        "show": directives.positive_int,
        "figure": directives.unchanged,
        "alt": directives.unchanged,
        "width": directives.unchanged,
    }

    def run(self) -> list[nodes.Node]:
        work = Path(self.env.app.outdir).parent / "manual-work"
        page, text = self.env.docname, "\n".join(self.content)
        folder = folder_of(work, page)
        commands = re.sub(r"\\\n", " ", text)
        kept = record_of(page, text)
        if "recorded" in self.options and not os.environ.get("MANUAL_RECORD"):
            if not kept.exists():
                logger.warning(
                    "no record of this block: python -m docs --record", location=self.get_location()
                )
                return []
            printed = kept.read_text(encoding="utf-8")
        else:
            pieces = []
            lines = [line[2:] for line in commands.splitlines() if line.startswith("$ ")]
            for number, line in enumerate(lines):
                code, output = run(line, folder, work)
                expected = self.options.get("exit", 0) if number == len(lines) - 1 else 0
                if code != expected:
                    logger.warning(
                        "%s: exit code %d, not %d:\n%s",
                        line,
                        code,
                        expected,
                        output,
                        location=self.get_location(),
                    )
                if output:
                    pieces.append(output)
            printed = "\n".join(pieces)
            if "recorded" in self.options:
                RECORDED.mkdir(exist_ok=True)
                kept.write_text(printed, encoding="utf-8")
        rows = printed.splitlines()
        if (most := self.options.get("show")) and len(rows) > most:
            rows = [*rows[:most], "..."]
        shown = "\n".join([text, *rows])
        block = nodes.literal_block(shown, shown, language="console")
        self.set_source_info(block)
        found: list[nodes.Node] = [block]
        if picture := self.options.get("figure"):
            if "recorded" in self.options and os.environ.get("MANUAL_RECORD"):
                shutil.copy(folder / picture, ROOT / "docs" / picture)
            found.append(
                self.picture(ROOT / "docs" / picture if "recorded" in self.options else folder / picture)
            )
        return found

    def picture(self, path: Path) -> nodes.Node:
        """A picture that the block wrote, beside the pages."""
        target = Path(self.env.app.srcdir) / "pictures" / f"{self.env.docname.replace('/', '-')}-{path.name}"
        target.parent.mkdir(exist_ok=True)
        if not path.exists():
            logger.warning("%s was not written", path.name, location=self.get_location())
            return nodes.paragraph()
        shutil.copy(path, target)
        image = nodes.image(uri=f"/pictures/{target.name}", alt=self.options.get("alt", path.stem))
        image["uri"] = os.path.relpath(target, Path(self.env.doc2path(self.env.docname)).parent)
        image["width"] = self.options.get("width", "100%")
        return image


class Python(SphinxDirective):
    """`{python}`."""

    has_content = True
    names: ClassVar[dict[str, dict[str, Any]]] = {}

    def run(self) -> list[nodes.Node]:
        work, page, text = (
            Path(self.env.app.outdir).parent / "manual-work",
            self.env.docname,
            "\n".join(self.content),
        )
        folder, printed = folder_of(work, page), io.StringIO()
        names = self.names.setdefault(page, {"__name__": "__main__"})
        try:
            with contextlib.chdir(folder), contextlib.redirect_stdout(printed):
                exec(compile(text, f"{page}, line {self.lineno}", "exec"), names)
        except Exception:
            logger.warning("%s", traceback.format_exc(limit=-3), location=self.get_location())
        found: list[nodes.Node] = []
        for shown, language in ((text, "python"), (printed.getvalue().rstrip(), "text")):
            if shown:
                block = nodes.literal_block(shown, shown, language=language)
                block["classes"] += ["printed"] if language == "text" else []
                self.set_source_info(block)
                found.append(block)
        return found


def setup(app: Any) -> dict[str, bool]:
    """Join it to Sphinx."""
    app.add_directive("console", Console)
    app.add_directive("python", Python)
    return {"parallel_read_safe": False, "parallel_write_safe": True}

"""Pages are true: equations name the functions that compute them, commands and options exist, examples load."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

pytest.importorskip("sphinx", reason="Sphinx is not installed (pip install 'pbekit[docs]')")

from docs.extensions import reference, sources
from mcdem.scene import load_scene

ROOT = Path(__file__).parents[2]
PAGES = sorted(path for path in (ROOT / "docs").rglob("*.md"))
METHOD = sorted((ROOT / "docs/method").glob("*.md"))


@pytest.mark.parametrize("page", METHOD, ids=lambda page: page.stem)
def test_every_equation_names_the_function_that_computes_it(page):
    text = page.read_text(encoding="utf-8")
    found = list(sources.links(text))
    assert not [name for _, name in found if sources.place_of(name) is None]
    labels = set(sources.LABELS.findall(text))
    # Definitions that no function stands for by itself.
    assert labels - {label for label, _ in found} <= {
        "waiting",
        "resistance",
        "squeeze",
        "stress-interpolation",
    } - {"squeeze" if "squeeze" in {label for label, _ in found} else ""}


def test_a_link_to_nothing_is_seen():
    assert sources.place_of("mcdem.effects.jkr.force") is not None
    assert sources.place_of("mcdem.effects.jkr.no_such_function") is None


@pytest.mark.parametrize(
    "path", sorted((ROOT / "docs/howto/examples").glob("*.toml")), ids=lambda path: path.stem
)
def test_scenes_of_the_manual_load(path):
    assert load_scene(path).question.endswith("?")


def shown_commands():
    """(page, words) of each command that a page shows without running it."""
    for page in [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]:
        text = page.read_text(encoding="utf-8")
        for block in re.findall(
            r"^```(?:\{code-block\} )?(?:console|bash)\n(.*?)^```", text, re.MULTILINE | re.DOTALL
        ):
            for line in re.sub(r"\\\n", " ", block).splitlines():
                for part in line.removeprefix("$ ").split("&&"):
                    words = shlex.split(part, comments=True)
                    if words and Path(words[0]).name in ("mcdem", "pbekit"):
                        yield page.name, [Path(words[0]).name, *words[1:]]
        for line in re.findall(r"`((?:mcdem|pbekit) [a-z][^`\n]*)`", text):
            yield page.name, shlex.split(line)


def test_commands_that_are_shown_exist_with_their_options():
    seen = 0
    for page, (program, command, *words) in shown_commands():
        if command.startswith("--"):
            continue
        known = reference.commands(program)
        assert command in known, (page, program, command)
        written = " ".join(p.written for p in reference.parameters_of(known[command]) if not p.is_argument)
        for word in words:
            if re.match(r"--?[a-z]", word):
                assert re.search(rf"(^|[\s,]){re.escape(word)}([\s,]|$)", written), (page, command, word)
        seen += 1
    assert seen > 40


def test_recorded_output_belongs_to_a_block():
    from docs.extensions.console import record_of

    blocks = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for options, content in re.findall(
            r"^```\{console\}\n((?::[^\n]*\n)*)(.*?)^```", text, re.MULTILINE | re.DOTALL
        ):
            if ":recorded:" in options:
                name = page.relative_to(ROOT / "docs").with_suffix("").as_posix()
                blocks.add(record_of(name, content.strip("\n")))
    assert blocks == set((ROOT / "docs/recorded").glob("*.txt"))

"""Pages are true: equations name the functions that compute them, commands and options exist, examples load."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

pytest.importorskip("sphinx", reason="Sphinx is not installed (pip install 'pbekit[docs]')")

from docs.extensions import console, reference, sources
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


def test_no_angle_brackets_are_taken_for_a_tag():
    """Markdown would swallow <P>: it is written ⟨P⟩, or as code."""
    notebooks = {
        path: "\n".join(
            "".join(cell["source"])
            for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]
            if cell["cell_type"] == "markdown"
        )
        for path in (ROOT / "notebooks").glob("*.ipynb")
    }
    for path, text in {**{page: page.read_text(encoding="utf-8") for page in PAGES}, **notebooks}.items():
        plain = re.sub(r"```.*?```|`[^`]*`|\$[^$]*\$|<!--.*?-->", "", text, flags=re.DOTALL)
        assert not re.search(r"<[A-Za-z]\w*>", plain), path.name


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


def recorded():
    """(page, commands) of every recorded block, in their order."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for options, content in re.findall(
            r"^```\{console\}\n((?::[^\n]*\n)*)(.*?)^```", text, re.MULTILINE | re.DOTALL
        ):
            if ":recorded:" in options:
                yield page.relative_to(ROOT / "docs").with_suffix("").as_posix(), content.strip("\n")


def test_recorded_output_belongs_to_a_block():
    blocks = {console.record_of(page, text) for page, text in recorded()}
    assert len(blocks) > 4
    assert blocks == set(console.RECORDED.glob("*.txt"))


def masked(text: str) -> tuple[str, list[float]]:
    """A text without its numbers, and these."""
    number = r"\d+(?:\.\d+)?(?:e[+-]?\d+)?"
    return re.sub(number, "#", text), [float(found) for found in re.findall(number, text)]


@pytest.mark.slow
def test_recorded_output_is_what_the_commands_print(tmp_path):
    """To the letter in words; numbers to a quarter: rounding differs between processors, and paths of aggregates diverge."""
    for page, text in recorded():
        lines = [line[2:] for line in re.sub(r"\\\n", " ", text).splitlines() if line.startswith("$ ")]
        printed = "\n".join(
            filter(
                None, (console.run(line, console.folder_of(tmp_path, page), tmp_path)[1] for line in lines)
            )
        )
        words, numbers = masked(printed)
        kept_words, kept_numbers = masked(console.record_of(page, text).read_text(encoding="utf-8"))
        assert words == kept_words, (page, text, printed)
        for now, kept in zip(numbers, kept_numbers, strict=True):
            assert now == pytest.approx(kept, rel=0.25, abs=30 if kept.is_integer() else 1e-12), (
                page,
                text,
                printed,
            )

"""No private word where the field has a term: docs, help, messages, docstrings, comments and notebooks are searched."""

from __future__ import annotations

import ast
import io
import json
import re
import subprocess
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.main import get_command

import mcdem.commands.main
import pbekit.commands.main

ROOT = Path(__file__).parents[2]
PLACES = (
    "mcdem",
    "pbekit",
    "validation",
    "benchmarks",
    "docs",
    "scenes",
    "notebooks",
    "tests",
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "CODE_OF_CONDUCT.md",
    "paper",
)
PROSE = {".py", ".pyi", ".md", ".toml", ".ipynb", ".j2", ".sbatch"}

WORDS = {
    r"\bclocks\b": "majorant rejection",
    r"\binversion\b": "inverse-transform sampling",
    r"\bforesight\b|\bforesee\w*|\bforeseen\b|\bforetell\w*|\bforetold\b": "speculative execution; predict",
    r"\bin vain\b": "discarded",
    r"\blag(ged|s)?\b": "frozen far field",
    r"\bkept (far field|matrix|factor|resistance|frame)\b": "frozen far field",
    r"\bdrives?\b(?! a pair)|\bdriven by the strain\b": "strain-induced force and torque; load",
    r"\bstepping\b|\bmarch(es|ed|ing)?\b": "time integration, time loop, trial step; scheme",
    r"\btumbl\w*|\broll(s|ed|ing)? on\b|\brest as (a )?bod\w+": "rigid-body rotation",
    r"\b(come|comes|came|coming) near\b|\bpass(es|ed)? on as\b|\bmove on as\b": "far-field approach, passage",
    r"\binert\b": "mechanically stable in every orientation",
    r"\b(bears?|bore|bearing|carry|carries) (bending )?moments\b|\bcontact moments\b|\bmoments of (the )?contacts\b": (
        "contact torques; transmit torques"
    ),
    r"\b(a|the|its|their|whose|summed) reach(es)?\b|\breach of (the|a|an|its)\b": "collision radius, outer radius, range",
    r"\bheld against\b": "compared with, checked against",
    r"\bfelt\b|\bfeels? each other\b": "load response; interact",
    r"\b(loose|literal|strict|three|two|other|each|this|that|first|second|own) readings?\b": "convention",
    r"\breadings? of (breakup|the cut-?off|the paper|Eq)|\bcut-?off.s reading\b": "convention",
    r"\bmcdem vary\b|\b`vary`": "mcdem sensitivity",
    r"\bmcdem thin\b|\bthinned\b(?=.*\b(run|dataset)s?\b)": "mcdem compress",
    r"\bswitch(es)?\b(?! (it )?(numba )?o(ff|n)\b)(?! (it|numba) )|\bswitched\b(?! (off|on)\b)": "ablation; change",
    r"\bclosures?\b": "estimated rates",
    r"`(closures?|compiled|finite|rooms?|inversion|clocks|foresight|march|stepping|lagged|rigid|approach)`": (
        "the name of the module as it is now"
    ),
    r"\brooms?\b(?! (for|above)\b)": "package",
    r"\bteach(es|ing)?\b|\btaught\b": "parameterise",
    r"\btells?\b(?!( (them|\d+ \w+|\w+))? apart\b)": "say, give, report, show",
    r"\btold\b(?! (apart|from)\b)": "said, given, reported, estimated",
    r"\bslow twins?\b": "slow reference",
    r"\bof before\b": "earlier, older",
    r"\bknobs?\b": "setting, key",
}
"""What is not written, as a pattern without regard to case, and what the field says instead."""

ALLOWED = (
    r"moment closures?",
    # The column of earlier tables.
    r"`knob`|\"knob\"",
    r"thin double layer",
    r"matrix inversion",
    r"wall[- ]clock",
    r"mcdem/commands/\w+\.py",
)
"""Uses of these words that are the field's, or plain English, or a name."""


def strings_and_comments(text: str) -> Iterator[tuple[int, str]]:
    """Comments, and string literals of more than one word, of a program."""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            for k, line in enumerate(node.value.splitlines()):
                yield node.lineno + k, line


def prose(path: Path) -> Iterator[tuple[int, str]]:
    """What is to be read in a file, with its lines."""
    text = path.read_text(encoding="utf-8")
    if path.suffix in (".py", ".pyi"):
        yield from strings_and_comments(text)
    elif path.suffix == ".ipynb":
        for k, cell in enumerate(json.loads(text)["cells"]):
            source = "".join(cell["source"])
            if cell["cell_type"] == "markdown":
                yield from ((k, line) for line in source.splitlines())
            else:
                magic = re.sub(r"^([%!])", r"# \1", source, flags=re.MULTILINE)
                yield from ((k, line) for _, line in strings_and_comments(magic))
    else:
        if path.name == "CHANGELOG.md":
            text = re.sub(r"^### Renamed\n.*?(?=^## |\Z)", "", text, flags=re.MULTILINE | re.DOTALL)
        yield from enumerate(text.splitlines(), 1)


def private_words(line: str) -> list[str]:
    """The words of a line that are not written, each with what the field says."""
    for allowed in ALLOWED:
        line = re.sub(allowed, "", line, flags=re.IGNORECASE)
    hits = ((re.search(word, line, re.IGNORECASE), better) for word, better in WORDS.items())
    return [f'"{hit[0]}": {better}' for hit, better in hits if hit]


EXEMPT = {"tests/project/test_words.py", "tests/scene/test_renamed_keys.py"}
"""Files that are about these very words."""


def files() -> list[Path]:
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", *PLACES],
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout.splitlines()  # fmt: skip
    return [
        ROOT / name
        for name in listed
        if Path(name).suffix in PROSE and name not in EXEMPT and (ROOT / name).exists()
    ]


IDENTIFIERS = {
    "told": "said, given, found",
    "tell": "report, say",
    "tells": "says, gives",
    "telling": "report",
    "knob": "key, what is varied",
    "vary": "compare settings",
    "switch": "changed assumption",
    "switches": "ablation",
    "engine": "executor",
    "engineerror": "ExecutorError",
    "closure": "estimated rates",
    "closures": "estimated rates",
    "foreseen": "predicted",
    "foresight": "speculative execution",
    "tumble": "rotate",
    "clocks": "majorant rejection",
    "stepping": "integration",
    "march": "time loop",
}
"""Words of which no function, class, module or argument is named, and the field's or plain ones."""


def identifiers(text: str) -> Iterator[str]:
    """Names of functions, classes and arguments, and module-wide names, of a program."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.arg):
            yield node.arg
    for node in tree.body:
        for target in getattr(node, "targets", [getattr(node, "target", None)]):
            if isinstance(target, ast.Name):
                yield target.id


def old_parts(name: str) -> set[str]:
    """The parts of a name, as of snake_case or CamelCase, that are of the old dialect."""
    parts = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower().split("_")
    return set(parts) & IDENTIFIERS.keys()


def test_nothing_is_named_by_a_private_word():
    found = {
        (str(path.relative_to(ROOT)), name)
        for path in files()
        if path.suffix in (".py", ".pyi")
        for name in [path.stem, *identifiers(path.read_text(encoding="utf-8"))]
        if old_parts(name)
    }
    assert not found


def test_a_name_is_taken_apart():
    source = "Told = 1\nclass EngineError: ...\ndef draw_switches(knob, reply): ..."
    assert {name for name in identifiers(source) if old_parts(name)} == {
        "Told", "EngineError", "draw_switches", "knob",
    }  # fmt: skip


def test_every_place_is_searched():
    found = {path.relative_to(ROOT).parts[0] for path in files()}
    assert found == set(PLACES)
    assert len(files()) > 250


def test_no_private_word_is_written():
    hits = [
        f"{path.relative_to(ROOT)}:{number}: {hit}"
        for path in files()
        for number, line in prose(path)
        for hit in private_words(line)
    ]
    assert not hits, "\n".join(hits)


@pytest.mark.parametrize(
    "line",
    [
        "each pair as often as f_ij asks, by the clocks",
        "encounters computed in vain",
        "the lagged far field",
        "the paper's own stepping",
        "an inert aggregate",
        "contacts that bear bending moments",
        "pairs closer than their summed reach",
        "the strict reading of breakup",
        "the steady size that the closure gives",
        "`mcdem thin` makes it small",
        "the balance it teaches",
        "the report tells which",
        "its error is told by tables left out",
    ],
)
def test_a_private_word_is_found(line):
    assert private_words(line)


@pytest.mark.parametrize(
    "line",
    [
        "a moment closure of the size distribution",
        "the thin double layer of Smoluchowski",
        "wall-clock time [s]",
        "colours tell them apart",
        "which cannot be told from the reference",
        "on reading a file",
        "A_H = 0 to switch it off",
        "the second moment grows, and the steady state is reached",
    ],
)
def test_a_word_of_the_field_is_not(line):
    assert not private_words(line)


@pytest.mark.parametrize(
    "program", [mcdem.commands.main.app, pbekit.commands.main.app], ids=["mcdem", "pbekit"]
)
def test_no_private_word_is_in_the_help(program):
    """The help as written; that it is shown to the letter is held by `test_help`."""
    group = get_command(program)
    assert len(group.commands) > 3
    for name, command in group.commands.items():
        texts = [command.help or "", command.short_help or ""]
        for option in command.params:
            texts += [
                option.name or "",
                *option.opts,
                getattr(option, "help", None) or "",
                str(option.metavar or ""),
            ]
        hits = [hit for text in texts for hit in private_words(text)]
        assert not hits, f"{name}: {hits}"
        assert not private_words(f"mcdem {name}")

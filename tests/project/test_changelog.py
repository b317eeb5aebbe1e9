"""CHANGELOG's tables of old and new names: complete, and true."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

from mcdem.commands.main import NOW_CALLED
from mcdem.quantities.renamed_keys import KEYS, VALUES

ROOT = Path(__file__).parents[2]
RENAMED = (
    (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").partition("### Renamed")[2].partition("\n## ")[0]
)
ROWS = re.findall(r"^\| (`.*|.*`.*) \| (.*) \|$", RENAMED, re.MULTILINE)


def known(name: str) -> bool:
    """Whether a dotted name is that of a module, or of something in one."""
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:k]))
        except ModuleNotFoundError:
            continue
        for part in parts[k:]:
            if not hasattr(found, part):
                return False
            found = getattr(found, part)
        return True
    return False


def dotted(text: str) -> list[str]:
    return re.findall(r"`((?:mcdem|pbekit)(?:\.\w+)+)`", text)


def test_every_new_name_is_there():
    names = [name for _, new in ROWS for name in dotted(new)]
    assert len(names) > 90
    assert not [name for name in names if not known(name)]


def test_every_renamed_module_is_there_under_its_new_name_only():
    modules = RENAMED.partition("| module |")[2]
    old = [re.match(r"\| `([\w.]+)`", line)[1] for line in modules.splitlines() if line.startswith("| `")]
    assert len(old) > 70
    now_packages = {"mcdem.encounter", "mcdem.hydrodynamics.two_sphere", "pbekit.balance", "pbekit.tables"}
    left = {
        name
        for name in old
        if (path := ROOT / name.replace(".", "/")).is_dir() or path.with_suffix(".py").exists()
    }
    assert left == now_packages


def test_every_renamed_command_and_key_is_listed():
    listed = dict(ROWS)
    for old, new in NOW_CALLED.items():
        assert listed[f"`mcdem {old}`"] == f"`mcdem {new}`"
    for old, new in KEYS.items():
        assert listed[f"`{old}`"] == f"`{new}`"
    for (key, old), new in VALUES.items():
        assert listed[f'`{key} = "{old}"`'] == f'`{key} = "{new}"`'

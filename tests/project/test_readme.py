"""What README says is so: its scene loads, its error message is the one printed, its map shows what is there."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mcdem.commands.main import app
from mcdem.errors import SceneError
from mcdem.scene import Scene

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()


def block(language):
    (found,) = re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)
    return found


def test_the_scene_is_the_papers():
    scene = Scene.from_text(block("toml"))
    paper = Scene.from_text((ROOT / "scenes/paper-1000Pa.toml").read_text())
    assert scene == paper
    assert scene.question.endswith("?")


def test_the_error_is_the_one_printed():
    wrong = block("toml").replace('"1e4 1/s"', '"1e4 s"')
    with pytest.raises(SceneError) as caught:
        Scene.from_text(wrong, "scene.toml")
    assert f"error: {caught.value}" in block("console")


def test_the_quickstart_runs(tmp_path, monkeypatch):
    """Word for word, but for the installation and with a stop after three encounters."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenes").symlink_to(ROOT / "scenes")
    (command,) = re.findall(r"<!-- quickstart -->\n```bash\n(.*)\n```", README)
    words = [shlex.split(part)[1:] for part in command.split(" && ") if part.startswith(".venv/bin/mcdem ")]
    assert [arguments[0] for arguments in words] == ["run", "plot"]
    for arguments in (words[0] + ["--events", "3", "--workers", "1"], words[1]):
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 0, done.output
    picture = words[1][words[1].index("-o") + 1]
    assert f'<img src="docs/{picture}"' in README
    assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")


def test_the_python_runs(capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    names = {}
    exec(compile(block("python"), "README.md", "exec"), names)
    assert capsys.readouterr().out.startswith("aggregation ")
    assert names["stiffer"].flow.shear_stress == 750.0


def test_the_commands_are_there():
    listed = re.findall(r"^\| `mcdem (\w+)", README, re.MULTILINE)
    assert len(listed) > 5
    assert set(listed) <= {command.callback.__name__ for command in app.registered_commands}


def test_the_map_shows_what_is_there():
    tree = README[README.index("## Map of the tree") :].split("```")[1]
    folder, places = Path(), []
    for line in tree.strip().splitlines():
        inside, names = re.match(r"( *)([^\s,]+(?:, [^\s,]+)*)", line).groups()
        folder = folder if inside else Path(names)
        places += [folder / name for name in names.split(", ")] if inside else [Path(names)]
    assert len(places) > 20
    assert not [str(place) for place in places if not (ROOT / place).exists()]

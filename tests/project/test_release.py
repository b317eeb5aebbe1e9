"""What is released: one version everywhere, one list of dependencies, and archives that hold the packages and run."""

import re
import subprocess
import sys
import tomllib
import venv
import zipfile
from pathlib import Path

import jinja2
import pytest

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def recipe():
    text = jinja2.Template(
        (ROOT / "conda/meta.yaml").read_text(encoding="utf-8"), undefined=jinja2.StrictUndefined
    )
    return yaml.safe_load(text.render(PYTHON="python"))


def test_one_version_everywhere():
    version = PROJECT["version"]
    assert recipe()["package"]["version"] == version
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["version"] == version
    assert re.search(
        rf"^## \[{re.escape(version)}\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE
    )


def test_the_recipe_asks_for_what_the_project_does():
    """By the names that conda has for them."""
    called = {"matplotlib-base": "matplotlib"}
    asked = {}
    for line in recipe()["requirements"]["run"]:
        name, _, bound = line.partition(" ")
        asked[called.get(name, name)] = bound
    needed = {"python": PROJECT["requires-python"]}
    for line in PROJECT["dependencies"]:
        name, bound = re.fullmatch(r"([\w.-]+)(.*)", line).groups()
        needed[name.lower()] = bound
    assert asked == needed


def test_issue_templates_are_forms():
    for path in (ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml"):
        form = yaml.safe_load(path.read_text(encoding="utf-8"))
        assert form["name"] and form["description"] and form["body"], path.name
    fault = (ROOT / ".github/ISSUE_TEMPLATE/fault.yml").read_text(encoding="utf-8").lower()
    assert all(word in fault for word in ("scene", "version", "dataset"))


@pytest.mark.slow
def test_archives_are_built_and_run(tmp_path):
    """A wheel made of the sdist, installed beside the dependencies that are there, answers from an empty folder."""
    pytest.importorskip("build", reason="build is not installed")
    subprocess.run(
        [sys.executable, "-m", "build", "--outdir", str(tmp_path), str(ROOT)], check=True, capture_output=True
    )
    (wheel,) = tmp_path.glob("*.whl")
    assert len(list(tmp_path.glob("*.tar.gz"))) == 1
    names = zipfile.ZipFile(wheel).namelist()
    for package in ("mcdem", "pbekit"):
        sources = {
            path.relative_to(ROOT).as_posix()
            for path in (ROOT / package).rglob("*.py*")
            if path.suffix in (".py", ".pyi")
        }
        assert sources <= set(names), sources - set(names)
    assert not [name for name in names if name.split("/")[0] in ("tests", "docs", "notebooks", "validation")]
    venv.create(tmp_path / "venv", with_pip=True)
    inside = tmp_path / "venv/bin"
    subprocess.run([inside / "pip", "install", "--quiet", "--no-deps", wheel], check=True)
    (site,) = (tmp_path / "venv/lib").glob("python*/site-packages")
    (site / "dependencies.pth").write_text(
        "\n".join(path for path in sys.path if path.endswith("site-packages")) + "\n"
    )
    for program in ("mcdem", "pbekit"):
        said = subprocess.run(
            [inside / program, "--version"],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            check=True,
            env={"PATH": ""},
        )
        assert said.stdout == f"pbekit {PROJECT['version']}\n"
    scene = subprocess.run(
        [inside / "mcdem", "check", ROOT / "scenes/quickstart.toml"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={"PATH": ""},
    )
    assert scene.returncode == 0 and "Peclet" in scene.stdout

"""The manual as it is read: in a browser, from the file system, without a network.  `python -m docs` builds it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("sphinx", reason="Sphinx is not installed (pip install 'pbekit[docs]')")

from docs.extensions import reference
from mcdem.scene import describe

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
BROWSER = os.environ.get("BROWSER_FOR_TESTS") or next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None
)


@pytest.fixture(scope="module")
def site():
    """The folder in which the manual is, built unless `MANUAL` says where it lies."""
    given = Path(os.environ.get("MANUAL", ROOT / "build/manual"))
    if not (given / "index.html").exists():
        subprocess.run([sys.executable, "-m", "docs", "-o", str(given)], cwd=ROOT, check=True)
    return given.resolve()


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if BROWSER is None:
        pytest.skip("no Chromium is installed (apt-get install chromium)")
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield chromium
        chromium.close()


def opened(browser, file):
    """The page, loaded with the network cut off; anything it asks of one and any error in it is kept."""
    page = browser.new_page(viewport={"width": 1200, "height": 900}, offline=True)
    page.troubles = []
    page.on("pageerror", lambda error: page.troubles.append(str(error)))
    page.on("requestfailed", lambda request: page.troubles.append(request.url))
    page.on(
        "request",
        lambda r: page.troubles.append(r.url) if not r.url.startswith(("file:", "data:", "blob:")) else None,
    )
    page.goto(f"file://{file}")
    return page


def pages(site):
    return [p for p in sorted(site.rglob("*.html")) if p.parts[-2] not in ("source", "_static")]


def test_every_page_loads_and_fits_wide_and_on_a_phone(browser, site):
    """Without an error, without the network, with its pictures, and never wider than the screen."""
    every = pages(site)
    assert len(every) > 40
    for file in [*every, site / "source/mcdem.effects.jkr.html"]:
        page = opened(browser, file)
        broken = page.evaluate(
            "Array.from(document.images).filter(i => !i.complete || i.naturalWidth === 0).map(i => i.src)"
        )
        for width in (1200, 390):
            page.set_viewport_size({"width": width, "height": 900})
            assert page.evaluate("document.documentElement.scrollWidth") <= width + 1, (file, width)
        assert page.troubles == [] and broken == [], file
        page.close()


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ("fragment distribution", "rates"),
        ("lubrication cut-off", "hydrodynamics"),
        ("zeta potential", "scene"),
    ],
)
def test_search_finds(browser, site, words, wanted):
    page = opened(browser, f"{site / 'search.html'}?q={words.replace(' ', '+')}")
    page.wait_for_selector("ul.search li a", timeout=30_000)
    page.wait_for_timeout(2000)
    links = page.eval_on_selector_all("ul.search li a", "links => links.map(a => a.getAttribute('href'))")
    assert any(wanted in link for link in links), links
    assert page.troubles == []
    page.close()


def test_formulas_are_drawn_and_numbered(browser, site):
    for file in sorted((site / "method").glob("*.html")):
        if file.stem == "index":
            continue
        page = opened(browser, file)
        boxes = page.evaluate(
            "Array.from(document.querySelectorAll('.formula svg')).map(s => { const b = s.getBBox();"
            " return [b.width, b.height, s.getBoundingClientRect().width] })"
        )
        assert boxes and all(w > 1 and h > 1 and shown > 1 for w, h, shown in boxes), file.name
        numbers = page.eval_on_selector_all(".equation .number", "n => n.map(e => e.innerText)")
        assert numbers or file.stem == "monte-carlo", file.name
        assert all(re.match(r"\(\d+(\.\d+)?\)", number) for number in numbers), (file.name, numbers)
        page.close()


def test_the_reference_holds_every_name_key_and_command(site):
    python = "".join(p.read_text(encoding="utf-8") for p in (site / "reference").glob("*.html"))
    for package in reference.packages():
        for name in reference.public(package):
            assert f'id="{reference.face_of(package, name)}.{name}"' in python, (package, name)
    scene = (site / "reference/scene.html").read_text(encoding="utf-8")
    for key in describe():
        if key.key:
            identity = f"{key.table}.{key.key}".replace(".", "-").replace("_", "-")
            assert f'id="key-{identity}"' in scene, identity
    commands = (site / "reference/commands.html").read_text(encoding="utf-8")
    for program in ("mcdem", "pbekit"):
        for name in reference.commands(program):
            assert f'id="{program}-{name}"' in commands


def test_equations_and_functions_link_to_each_other(browser, site):
    page = opened(browser, site / "method/forces.html")
    page.click("a.source:has-text('force') >> nth=0")
    assert "/source/mcdem.effects.van_der_waals.html#L-" in page.url
    page.click("a:has-text('Eq. (') >> nth=0")
    assert "/method/forces.html#equation-" in page.url
    page.close()

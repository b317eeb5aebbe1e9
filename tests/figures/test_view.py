"""The page works in a real browser without a network: it turns and it plays."""

import io
import os
import shutil
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from small_runs import small_runs
from trimer import turning_trimer
from typer.testing import CliRunner

from mcdem.commands.main import app
from mcdem.encounter import trajectory

pytest.importorskip("k3d", reason="k3d is not installed")
BROWSER = os.environ.get("BROWSER_FOR_TESTS") or next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None
)


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if BROWSER is None:
        pytest.skip("no Chromium is installed (apt-get install chromium)")
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(
            executable_path=BROWSER,
            args=[
                "--no-sandbox",
                "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader",
                "--ignore-gpu-blocklist",
            ],
        )
        yield chromium
        chromium.close()


def opened(browser, file):
    """The page, loaded with the network cut off; anything it asks for and any error in it is kept."""
    page = browser.new_page(viewport={"width": 700, "height": 500}, offline=True)
    page.troubles = []
    page.on("pageerror", lambda error: page.troubles.append(str(error)))
    page.on(
        "request",
        lambda r: page.troubles.append(r.url) if not r.url.startswith(("file:", "data:", "blob:")) else None,
    )
    page.goto(f"file://{file}")
    page.wait_for_selector("body[data-ready]", state="attached", timeout=60_000)
    page.wait_for_timeout(1000)
    return page


def seen(page):
    """What the browser shows below the controls, as numbers."""
    picture = Image.open(io.BytesIO(page.screenshot(clip={"x": 0, "y": 80, "width": 700, "height": 420})))
    return np.asarray(picture.convert("RGB"), dtype=int)


def coloured(picture):
    return int((np.ptp(picture, axis=2) > 40).sum())


@pytest.fixture(scope="module")
def encounter_file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("view")
    trajectory.write(turning_trimer(41), folder / "encounter.nc")
    done = CliRunner().invoke(app, ["view", str(folder / "encounter.nc")])
    assert done.exit_code == 0, done.output
    return folder / "encounter.html"


def drawn(page, wanted, words):
    """Wait until the picture is as wanted: drawing without a graphics card takes its time on a busy machine."""
    for _ in range(60):
        picture = seen(page)
        if wanted(picture):
            return picture
        page.wait_for_timeout(500)
    raise AssertionError(words)


def moved(before):
    """Whether a picture is another than `before`."""
    return lambda now: (np.abs(now - before).max(axis=2) > 40).sum() > 300


def test_encounter_turns_and_plays(browser, encounter_file):
    page = opened(browser, encounter_file)
    first = seen(page)
    assert coloured(first) > 300, "no spheres are drawn"

    page.mouse.move(350, 300)
    page.mouse.down()
    page.mouse.move(470, 220, steps=6)
    page.mouse.up()
    turned = drawn(page, moved(first), "dragging does not turn the view")

    assert page.evaluate("document.body.dataset.frame") == "0"
    page.click("#play")
    page.wait_for_function("+document.body.dataset.frame > 8", timeout=30_000)
    page.click("#play")
    stopped = page.evaluate("document.body.dataset.frame")
    page.wait_for_timeout(500)
    assert page.evaluate("document.body.dataset.frame") == stopped, "pause does not stop it"
    drawn(page, moved(turned), "playing does not move anything")
    assert page.inner_text("#now").startswith("strain ")
    assert page.troubles == []
    page.close()


@pytest.mark.parametrize("radii", [None, (1.0, 1.0, 0.6)])
def test_bonds_are_shown_on_demand(browser, tmp_path, radii):
    shown = turning_trimer(3)
    shown = replace(shown, radii=None if radii is None else shown.radius * np.array(radii))
    trajectory.write(shown, tmp_path / "encounter.nc")
    assert CliRunner().invoke(app, ["view", str(tmp_path / "encounter.nc")]).exit_code == 0
    page = opened(browser, tmp_path / "encounter.html")
    before = coloured(seen(page))
    page.check("#small")
    drawn(page, lambda now: coloured(now) < 0.6 * before, "the spheres do not shrink")
    assert page.troubles == []
    page.close()


def test_population_is_shown(browser, tmp_path):
    done = CliRunner().invoke(app, ["view", str(small_runs()[1]), "-o", str(tmp_path / "population.html")])
    assert done.exit_code == 0, done.output
    page = opened(browser, tmp_path / "population.html")
    assert coloured(seen(page)) > 2000
    assert "aggregates at t" in page.inner_text("#bar")
    assert page.troubles == []
    page.close()


def test_snapshot_that_is_not_there_is_refused(tmp_path):
    refused = CliRunner().invoke(
        app, ["view", str(small_runs()[1]), "-o", str(tmp_path / "p.html"), "--snapshot", "999"]
    )
    assert refused.exit_code == 2 and "no snapshot 999" in refused.output
    absent = CliRunner().invoke(app, ["view", str(tmp_path / "no.nc")])
    assert absent.exit_code == 2 and "no such file" in absent.output

"""Whatever stands in a scene file, it is a scene or refused in lines that name it, at once and without a traceback."""

from __future__ import annotations

import datetime
import time
import tomllib
from functools import cache
from pathlib import Path

import pytest
import tomlkit
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import mcdem
from mcdem.analysis.dimensionless_groups import check
from mcdem.errors import SceneError
from mcdem.quantities.unit_factors import known_units
from mcdem.scene import LARGEST_FILE, Scene, describe

PAPER = Path(__file__).parents[2] / "scenes" / "paper-1000Pa.toml"
TEXT = PAPER.read_text()
KEYS = [f"{key.table}.{key.key}" for key in describe() if key.key]
TABLES = {
    "effects.double_layer": {
        "surface_potential": "-25 mV",
        "debye_length": "10 nm",
        "relative_permittivity": 78.5,
        "condition": "constant_potential",
    },
    "effects.dmt": {"surface_energy": "4.7 mJ/m^2", "elastic_modulus": "3.4 GPa", "poisson_ratio": 0.5},
    "effects.born": {"collision_diameter": "0.5 nm"},
    "effects.steric": {"brush_thickness": "10 nm", "grafting_distance": "3 nm", "temperature": "298 K"},
    "effects.sliding": {"friction_coefficient": 0.3},
    "effects.rolling": {"critical_displacement": "0.5 nm"},
    "effects.twisting": {"friction_coefficient": 0.3},
    "effects.rods": {"stiffness": "5 N/m", "largest_displacement": "2 nm"},
}
"""A table of each effect that the scene does not have; put there before one of its keys is changed."""
ALONE = {"effects.born", "effects.steric", "effects.dmt"}
"""Effects that do not go with the JKR contacts of the scene."""

UNITS = [
    *sorted(known_units()),
    "",
    "1/s",
    "J/m^2",
    "Pa s",
    "1/nm",
    "N/m",
    "kg/m^3",
    "B",
    "furlong",
    "nm # x",
    "nm nm",
    "^",
    "/",
]
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=30)
numbers = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.integers(-(10**400), 10**400),
    st.integers(-3, 3),
    st.sampled_from([1e300, 1e-300, -1e300, 5e-324, 1e999, 0.0, -0.0, 2**63, 2**64, 10**20]),
)
quantities = st.builds(
    lambda number, unit: f"{number} {unit}",
    st.one_of(
        numbers,
        st.sampled_from(["1e999999999", "-1e-999999999", "1" * 400, "0x10", "1_0", "5,5", "٥", "+-1"]),
    ),
    st.sampled_from(UNITS),
)
plain = st.one_of(numbers, quantities, st.booleans(), TEXTS, st.dates(), st.just(datetime.time(1, 2)))
values = st.recursive(
    plain,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=6,
)


@cache
def around(key: str) -> tuple[str, str]:
    """The paper's scene before and after the value of a key."""
    document = tomlkit.parse(TEXT)
    *path, last = key.split(".")
    name = ".".join(path)
    if name in ALONE:
        document["effects"].pop("jkr")
    table = document
    for part in path:
        table = table.setdefault(part, tomlkit.table())
    for other, given_value in TABLES.get(name, {}).items():
        table[other] = given_value
    table[last] = "HERE"
    before, after = tomlkit.dumps(document).split('"HERE"')
    return before, after


def written(value: object) -> str:
    """A value in TOML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return tomlkit.string(value).as_string()
    if isinstance(value, list):
        return f"[{', '.join(map(written, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{written(name)} = {written(inner)}" for name, inner in value.items()) + "}"
    return str(value)


def scene_text(key: str, value: object) -> str:
    """The paper's scene with a value at a key."""
    before, after = around(key)
    return before + written(value) + after


def read(text: str) -> Scene | None:
    """The scene, or None where it is refused; asserts what a refusal looks like, and how long either takes."""
    started = time.process_time()
    try:
        found = Scene.from_text(text, "here.toml")
    except SceneError as refused:
        found = None
        lines = str(refused).split("\n")
        assert all(line.startswith("here.toml: ") and line.isprintable() for line in lines), lines
        assert len(lines) <= 21 and max(map(len, lines)) < 700, lines
    assert time.process_time() - started < 1.0
    return found


def hold(key: str, value: object) -> bool:
    """A value at a key is refused, or gives a scene that reads as itself and that `check` can judge."""
    found = read(scene_text(key, value))
    if found is None:
        return False
    assert Scene.from_text(found.text) == found
    for finding in check(found):
        assert finding.words.isprintable()
    return True


PATIENT = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}


@settings(max_examples=300, **PATIENT)
@given(st.sampled_from(KEYS), values)
def test_any_value_at_any_key_is_read_or_refused(key, value):
    hold(key, value)


@pytest.mark.slow
@settings(max_examples=10_000, **PATIENT)
@given(st.sampled_from(KEYS), values)
def test_thousands_of_values_are_read_or_refused(key, value):
    hold(key, value)


@settings(max_examples=100, **PATIENT)
@given(TEXTS, st.integers(0, len(TEXT)), st.integers(0, 40))
def test_random_text_around_and_within(text, at, lost):
    read(TEXT[:at] + text + TEXT[at + lost :])


@pytest.mark.slow
@settings(max_examples=4000, **PATIENT)
@given(TEXTS, st.integers(0, len(TEXT)), st.integers(0, 200))
def test_much_random_text_around_and_within(text, at, lost):
    read(TEXT[:at] + text + TEXT[at + lost :])


@pytest.mark.parametrize("key", KEYS)
def test_extremes_of_every_key(key):
    """Each end of what can be written, of every dimension: mostly refused, never a traceback."""
    extremes = [
        "1e999999999 nm",
        "9" * 400 + " m",
        "1e300 m",
        "1e-300 m",
        10**4000,
        -1,
        0,
        1e300,
        "inf s",
        "",
        [],
        [[]],
        {"a": {}},
    ]
    for value in [
        *extremes,
        *(f"{number} {unit}" for number in ("1e-300", "1e290") for unit in ("m", "s", "Pa", "J", "V", "K")),
    ]:
        hold(key, value)


# What was met in use, each of which ended in a traceback, in a wrong number or in minutes of silence.

HUGE = {
    "nested lists": "x = " + "[" * 30_000,
    "nested tables": "x = " + "{b=" * 5_000,
    "a number of 5000 digits": f"[population]\ninitial = {'9' * 1900}\nx = " + "9" * 5000,
    "a key of many dots": "a." * 30_000 + "b = 1",
    "many keys of many dots": "\n".join(f"{'a.' * 990}b{k} = 1" for k in range(30)),
    "many unknown keys": "\n".join(f"key_number_{k} = 1" for k in range(3000)),
    "a long file": "#" * 80 + "\n" + "\n".join(["# a comment"] * 6000),
    "a day that no month has": "x = 2023-02-30",
    "nothing": "",
    "NUL": "x = 5\0",
}


@pytest.mark.parametrize("name", HUGE)
def test_too_much_is_refused_at_once(name):
    started = time.process_time()
    with pytest.raises(SceneError) as caught:
        Scene.from_text(HUGE[name], "here.toml")
    assert time.process_time() - started < 1.0
    assert str(caught.value).count("\n") <= 20
    assert all(line.startswith("here.toml: ") and len(line) < 400 for line in str(caught.value).split("\n"))


@pytest.mark.parametrize(
    "change",
    [
        ('"500 nm"', '"5 nm # thousand"'),
        ('"500 nm"', r'"5\u0000nm"'),
        ('"500 nm"', '"5 nm nm"'),
        ('"500 nm"', '"1e999999999 nm"'),
        ('"500 nm"', '"' + "9" * 400 + ' nm"'),
        ('"500 nm"', '"1e300 m"'),
        ('"500 nm"', '"1e-300 m"'),
        ("1e-4", '"5 B"'),
        ('"0.165 nm"', '"1e-300 m"'),
        ('"0.165 nm"', '"1 um"'),
        ('"4.7e-3 J/m^2"', '"1e300 J/m^2"'),
        ('"4.7e-3 J/m^2"', '"900 J/m^2"'),
        ('"3.4 GPa"', '"1e-300 Pa"'),
        ("initial = 200", "initial = 999999999999999"),
    ],
)
def test_what_was_met_in_use_is_refused(change):
    old, new = change
    assert TEXT.count(old) == 1, old
    with pytest.raises(SceneError) as caught:
        Scene.from_text(TEXT.replace(old, new), "here.toml")
    assert "\n" not in str(caught.value) and "expected" in str(caught.value)


def test_the_third_of_the_flow_is_bounded_too():
    text = TEXT.replace('"1e4 1/s"', '"1e-9 1/s"').replace('"100 cP"', '"1e-9 Pa s"')
    with pytest.raises(
        SceneError, match=r"shear_stress = 1e-18 Pa, which follows .* out of bounds; expected a stress from"
    ):
        Scene.from_text(text)


def test_files(tmp_path):
    """A byte-order mark and line ends of Windows are read; a device without end, and what is no text, are refused."""
    marked = tmp_path / "marked.toml"
    marked.write_bytes(b"\xef\xbb\xbf" + TEXT.replace("\n", "\r\n").encode())
    assert mcdem.load_scene(marked) == Scene.from_text(TEXT)
    long = tmp_path / "long.toml"
    long.write_bytes(b"# x\n" * LARGEST_FILE)
    for path, words in [
        (long, "expected at most"),
        ("a\0b", "not the name of a file"),
        (7, "the name of a scene file"),
    ]:
        with pytest.raises(SceneError, match=words):
            mcdem.load_scene(path)


def test_examples_fit_their_keys():
    """`mcdem describe` shows for each quantity a value that its key takes, and in its own order of magnitude."""
    for key in describe():
        if "such as" not in key.expected or key.expected.startswith("a list"):
            continue
        example = tomllib.loads(f"x = {key.expected.rpartition('such as ')[2]}")["x"]
        text = scene_text(f"{key.table}.{key.key}", example)
        try:
            Scene.from_text(text)
        except SceneError as refused:
            # Another key may forbid this one, but never for its own value.
            assert "; expected" not in str(refused), (key, str(refused))


def test_a_fuzzed_value_can_be_read_at_every_key():
    """The fuzz is not of refusals alone: some value in reach of it is read at each key."""
    reached = [
        *(
            f"{n} {unit}"
            for n in (5, "0.01")
            for unit in ("nm", "s", "Pa", "V", "K", "N/m", "J/m^2", "1/s", "Pa s", "mM", "mV")
        )
    ]
    choices = [
        "planar",
        "matrix",
        "implicit",
        "relative",
        "inverse_transform",
        "stokesian",
        "constant_potential",
        "1e-20 J",
        "50 GPa",
    ]
    needs_another = {
        "flow.alpha",
        "flow.gradient",
        "flow.shear_stress",
        "suspension.radii",
        "suspension.number_fractions",
    }
    needs_another |= {
        "flow.kind",
        "effects.double_layer.zeta_potential",
        "effects.double_layer.minimum_approach",
    }
    needs_another |= {"effects.double_layer.salt_concentration", "effects.double_layer.temperature"}
    tried = [*reached, *choices, 0.3, 1.5, 3, True]
    unread = {key for key in KEYS if not any(read(scene_text(key, value)) for value in tried)}
    assert unread <= needs_another

"""A scene file is read exactly, once, and refused in words that name the place and the cure."""

import math
import pickle
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import mcdem
from mcdem.errors import SceneError
from mcdem.quantities import units
from mcdem.scene import Scene, describe

SCENES = sorted((Path(__file__).parents[2] / "scenes").glob("*.toml"))
PAPER = Path(__file__).parents[2] / "scenes" / "paper-750Pa.toml"
TEXT = PAPER.read_text()


def refusal(text):
    """The one line with which a text is refused."""
    with pytest.raises(SceneError) as caught:
        Scene.from_text(text, "here.toml")
    message = str(caught.value)
    assert message.startswith("here.toml: ")
    assert "\n" not in message
    return message.removeprefix("here.toml: ")


def edited(old, new):
    assert TEXT.count(old) == 1, f"{old!r} must occur once in the scene that the test edits"
    return TEXT.replace(old, new)


# What the paper says (Frungieri & Vanni 2021, Table 1 and sections 2.2.1, 2.2.3, 3).


@pytest.mark.parametrize(("stress", "viscosity"), [(750, 0.075), (875, 0.0875), (1000, 0.1)])
def test_scenes_are_the_papers(stress, viscosity):
    scene = mcdem.load_scene(PAPER.with_name(f"paper-{stress}Pa.toml"))
    assert scene.name == f"paper-{stress}Pa"
    assert (scene.suspension.radius, scene.suspension.volume_fraction) == (5e-7, 1e-4)
    assert (scene.flow.shear_rate, scene.flow.viscosity) == (1e4, viscosity)
    assert scene.flow.shear_stress == pytest.approx(stress, rel=1e-15)
    van_der_waals, jkr = scene.effects.get("van_der_waals"), scene.effects.get("jkr")
    assert (van_der_waals.hamaker_constant, van_der_waals.minimum_approach) == (9.7e-21, 1.65e-10)
    assert (jkr.surface_energy, jkr.elastic_modulus, jkr.poisson_ratio) == (4.7e-3, 3.4e9, 0.5)
    assert scene.hydrodynamics.lubrication_cutoff == 5e-3
    assert (scene.numerics.rotations, scene.numerics.explicit_euler.base_step) == (8, 1e-6)
    assert scene.population.initial * scene.population.doubling_below == 150


def test_quickstart_is_the_1000_pa_suspension_stopped_early():
    quickstart = mcdem.load_scene(PAPER.with_name("quickstart.toml"))
    paper = mcdem.load_scene(PAPER.with_name("paper-1000Pa.toml"))
    assert quickstart.run.until == 10.0
    assert paper.with_changes({"run.until": "10 s"}) == quickstart


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_every_scene_asks_a_question(path):
    assert mcdem.load_scene(path).question.endswith("?")


# Laws of the whole.


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_round_trips(path):
    scene = mcdem.load_scene(path)
    assert scene.path == path
    assert scene.text == path.read_text()
    assert Scene.from_text(scene.text) == scene
    back = pickle.loads(pickle.dumps(scene))
    assert (back, back.text, back.path, hash(back)) == (scene, scene.text, scene.path, hash(scene))


def test_equal_when_the_content_is():
    scene = Scene.from_text(TEXT)
    worded_otherwise = (
        TEXT.replace('"500 nm"', '"0.5 um"').replace("# Their", "# In their").replace("1e-4", '"0.01 %"')
    )
    assert Scene.from_text(worded_otherwise) == scene
    assert Scene.from_text(TEXT.replace('"500 nm"', '"501 nm"')) != scene


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_a_scene_made_in_python_writes_its_own_text(path):
    scene = mcdem.load_scene(path)
    made = Scene.model_validate(tomllib.loads(scene.text))
    assert Scene.from_text(made.text) == scene
    wider = scene.model_copy(
        update={"suspension": scene.suspension.model_copy(update={"volume_fraction": 3e-4})}
    )
    assert Scene.from_text(wider.text) == wider
    assert wider.with_changes({"suspension.volume_fraction": 1e-4}) == scene


def test_a_scene_does_not_change():
    scene = Scene.from_text(TEXT)
    for table, key, value in [
        (scene, "flow", scene.flow),
        (scene.flow, "shear_rate", 1.0),
        (scene.run, "new", 1),
    ]:
        with pytest.raises(ValueError, match=r"frozen|Instance"):
            setattr(table, key, value)


@pytest.mark.parametrize("level", ["free_draining", "rotne_prager", "fts"])
def test_a_level_without_lubrication_takes_none_of_its_keys(level):
    paper = mcdem.load_scene(PAPER)
    with pytest.raises(
        SceneError, match=f'level = "{level}" is without lubrication, so that lubrication_cutoff'
    ):
        paper.with_changes({"hydrodynamics.level": level})
    bare = {"hydrodynamics.level": level, "hydrodynamics.lubrication_cutoff": None}
    with pytest.raises(SceneError, match="cutoff_convention would do nothing"):
        paper.with_changes(bare | {"hydrodynamics.cutoff_convention": "gap"})
    scene = paper.with_changes(bare)
    assert Scene.from_text(scene.model_copy(update={"run": scene.run}).text) == scene


def test_what_the_file_does_not_name_is_absent():
    bare = Scene.from_text(TEXT[: TEXT.index("[effects.van_der_waals]")])
    assert all(effect is None for _, effect in bare.effects)
    assert bare.numerics == Scene.from_text(TEXT).numerics
    assert bare.run.until is None


@pytest.mark.parametrize(
    "pair", [("shear_rate", "viscosity"), ("shear_rate", "shear_stress"), ("viscosity", "shear_stress")]
)
def test_two_of_the_flow_give_the_third(pair):
    values = {"shear_rate": "1e4 1/s", "viscosity": "75 mPa s", "shear_stress": "750 Pa"}
    written = "".join(f'{key} = "{values[key]}"\n' for key in pair)
    text = edited('shear_rate = "1e4 1/s"\nviscosity = "75 cP"\n', written)
    flow = Scene.from_text(text).flow
    assert (flow.shear_rate, flow.viscosity, flow.shear_stress) == pytest.approx(
        (1e4, 0.075, 750.0), rel=1e-15
    )


def test_reduced_units_make_stokes_drag_one():
    scene = Scene.from_text(TEXT)
    a, mu, g = scene.suspension.radius, scene.flow.viscosity, scene.flow.shear_rate
    reduced = scene.reduced
    assert reduced.force / (6 * math.pi * mu * a * reduced.velocity) == pytest.approx(1.0, rel=1e-15)
    assert reduced.energy / (8 * math.pi * mu * a**3 * g) == pytest.approx(6 / 8, rel=1e-15)
    assert reduced.stiffness * reduced.length == pytest.approx(reduced.force, rel=1e-15)


# Changes, as a sweep makes them.


def test_a_new_stress_replaces_the_viscosity():
    scene = mcdem.load_scene(PAPER)
    changed = scene.with_changes({"flow.shear_stress": "1000 Pa"})
    assert (changed.flow.shear_rate, changed.flow.viscosity) == (1e4, 0.1)
    assert changed.flow == mcdem.load_scene(PAPER.with_name("paper-1000Pa.toml")).flow
    assert changed.question == scene.question
    assert scene.flow.shear_stress == 750.0
    again = changed.with_changes({"flow.viscosity": "75 cP"})
    assert again == scene


def test_changes_add_and_remove_keys_and_tables():
    scene = mcdem.load_scene(PAPER)
    without = scene.with_changes({"effects.jkr": None, "numerics.implicit.max_step": 0.05, "run.events": 7})
    assert (without.effects.get("jkr"), without.numerics.implicit.max_step, without.run.events) == (
        None,
        0.05,
        7,
    )
    table = tomllib.loads(TEXT)["effects"]["jkr"]
    assert (
        without.with_changes({"effects.jkr": table, "numerics.implicit.max_step": None, "run.events": None})
        == scene
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"flow.shear_strss": "750 Pa"}, '[flow] unknown key "shear_strss"; did you mean "shear_stress"?'),
        (
            {"flow.shear_stress": -750.0},
            '[flow] shear_stress = "-750.0 Pa" is not positive; expected a stress from 1e-12 Pa to 1e12 Pa, such as "750 Pa"',
        ),
        ({"flow.shear_rate.x": 1}, '"shear_rate" is a key, not a table'),
        ({"numerics.implicit.max_step": -1.0}, "[numerics.implicit] max_step = -1.0 is not positive"),
    ],
)
def test_changes_pass_the_same_checks(changes, words):
    with pytest.raises(SceneError) as caught:
        mcdem.load_scene(PAPER).with_changes(changes)
    assert words in str(caught.value)
    assert PAPER.stem in str(caught.value)


# Refused at the door.

MISTAKES = {
    "unknown key": (
        'radius = "500 nm"', 'radios = "500 nm"',
        '[suspension] unknown key "radios"; did you mean "radius"?',
    ),
    "unknown key without a neighbour": (
        "initial = 200", "initial = 200\nxyzzy = 1",
        '[population] unknown key "xyzzy"; known here: initial, doubling_below, restructuring',
    ),
    "unknown table": ("[population]", "[populaton]", 'unknown table "populaton"; did you mean "population"?'),
    "unknown effect": ("[effects.jkr]", "[effects.jrk]", '[effects] unknown table "jrk"; did you mean "jkr"?'),
    "wrong dimension": (
        '"500 nm"', '"500 Pa"',
        '[suspension] radius = "500 Pa" has the wrong dimension (Pa); expected a length from 0.1 nm to 1 cm, such as "500 nm"',
    ),
    "no unit": (
        '"500 nm"', "500", '[suspension] radius = 500 has no unit; expected a length from 0.1 nm to 1 cm, such as "500 nm"'
    ),
    "no unit in text": (
        '"500 nm"', '"500"', '[suspension] radius = "500" has no unit; expected a length from 0.1 nm to 1 cm, such as "500 nm"'
    ),
    "unknown unit": (
        '"500 nm"', '"500 nn"',
        '[suspension] radius = "500 nn" is not a number with a unit that can be read; '
        'expected a length from 0.1 nm to 1 cm, such as "500 nm"',
    ),
    "decimal comma": (
        '"500 nm"', '"5,5 nm"',
        '[suspension] radius = "5,5 nm" is not a number with a unit that can be read; '
        'expected a length from 0.1 nm to 1 cm, such as "500 nm"',
    ),
    "negative": (
        '"500 nm"', '"-500 nm"',
        '[suspension] radius = "-500 nm" is not positive; expected a length from 0.1 nm to 1 cm, such as "500 nm"',
    ),
    "zero": (
        '"0.165 nm"', '"0 nm"',
        '[effects.van_der_waals] minimum_approach = "0 nm" is not positive; '
        'expected a length from 1e-15 m to 1 mm, such as "0.165 nm"',
    ),
    "zero shear rate": (
        '"1e4 1/s"', '"0 1/s"',
        '[flow] shear_rate = "0 1/s" is not positive; expected a rate from 1e-9 1/s to 1e12 1/s, such as "1e4 1/s"',
    ),
    "NaN": (
        "volume_fraction = 1e-4", "volume_fraction = nan",
        "[suspension] volume_fraction = nan is not finite; expected a number from 1e-15 to 0.74, such as 1e-4",
    ),
    "NaN with a unit": (
        '"500 nm"', '"nan nm"',
        '[suspension] radius = "nan nm" is not finite; expected a length from 0.1 nm to 1 cm, such as "500 nm"',
    ),
    "infinite": (
        '"300 s"', '"inf s"', '[run] until = "inf s" is not finite; expected a time from 1e-15 s to 1e15 s, such as "10 s"'
    ),
    "denser than a packing": (
        "volume_fraction = 1e-4", "volume_fraction = 0.9",
        "[suspension] volume_fraction = 0.9 is out of bounds; expected a number from 1e-15 to 0.74, such as 1e-4",
    ),
    "not an integer": ("initial = 200", "initial = 200.5", "[population] initial = 200.5; expected an integer from 2 to 1000000"),
    "text for a number": (
        "initial = 200", 'initial = "200"', '[population] initial = "200"; expected an integer from 2 to 1000000'
    ),
    "unknown choice": (
        'scheme = "implicit"', 'scheme = "explicit"',
        '[numerics] scheme = "explicit"; expected "implicit" or "explicit_euler"',
    ),
    "three of the flow": (
        'viscosity = "75 cP"', 'viscosity = "75 cP"\nshear_stress = "750 Pa"',
        "[flow] give exactly two of shear_rate, viscosity and shear_stress "
        "(found shear_rate and shear_stress and viscosity)",
    ),
    "one of the flow": (
        'viscosity = "75 cP"\n', "",
        "[flow] give exactly two of shear_rate, viscosity and shear_stress (found shear_rate)",
    ),
    "missing key": (
        'radius = "500 nm"\n', "",
        '[suspension] give radius, such as "500 nm", or radii and their number_fractions (found neither)',
    ),
    "missing table": (
        '[suspension]\nradius = "500 nm"\nvolume_fraction = 1e-4\n', "",
        "table [suspension] is missing; `mcdem describe` lists its keys",
    ),
    "not TOML": ('radius = "500 nm"', 'radius = "500 nm', "not valid TOML: "),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_refused_in_one_line_that_names_the_place_and_the_cure(mistake):
    old, new, words = MISTAKES[mistake]
    message = refusal(edited(old, new))
    assert message.startswith(words) if words.endswith(": ") else message == words


def test_a_table_of_the_wrong_kind():
    rest = TEXT.replace("[effects.van_der_waals]", "[population.a]").replace(
        "[effects.jkr]", "[population.b]"
    )
    assert '"effects" is a table; write [effects] and its keys below' in _all_refusals("effects = 3\n" + rest)


def test_several_mistakes_are_reported_together():
    text = edited('"500 nm"', '"500 Pa"').replace('"75 cP"', '"-75 cP"')
    lines = _all_refusals(text).splitlines()
    assert [line.split(" = ")[0] for line in lines] == [
        "here.toml: [suspension] radius",
        "here.toml: [flow] viscosity",
    ]


def _all_refusals(text):
    with pytest.raises(SceneError) as caught:
        Scene.from_text(text, "here.toml")
    return str(caught.value)


def test_unreadable_files(tmp_path):
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"radius = \xff\xfe")
    for path, words in [
        (tmp_path / "none.toml", "cannot be read: No such file or directory"),
        (tmp_path, "cannot be read: Is a directory"),
        (binary, "cannot be read: byte 9 is not UTF-8 text"),
    ]:
        with pytest.raises(SceneError) as caught:
            mcdem.load_scene(path)
        assert str(caught.value) == f"{path}: {words}"


# Units.

QUANTITIES = [value for value in vars(units).values() if isinstance(value, units.Quantity)]


@pytest.mark.parametrize("quantity", QUANTITIES, ids=lambda quantity: quantity.dimension)
def test_each_quantity_reads_its_own_example_and_no_other_dimension(quantity):
    example = quantity.example.strip('"')
    assert math.isfinite(quantity.to_si(example))
    registry = units.unit_registry()
    for other in QUANTITIES:
        same = (
            registry.parse_units(other.si).dimensionality == registry.parse_units(quantity.si).dimensionality
        )
        if same:
            assert quantity.to_si(f"3 {other.si}") == 3.0
        else:
            with pytest.raises(ValueError, match=r"has the wrong dimension|has no unit"):
                quantity.to_si(f"3 {other.si}")


@pytest.mark.parametrize(
    ("quantity", "text", "value"),
    [
        (units.LENGTH, "500 nm", 5e-7),
        (units.LENGTH, "500nm", 5e-7),
        (units.LENGTH, "0.5 µm", 5e-7),
        (units.VISCOSITY, "100 mPa s", 0.1),
        (units.VISCOSITY, "75 cP", 0.075),
        (units.VISCOSITY, "1 mPa*s", 1e-3),
        (units.ENERGY, "0.97e-20 J", 9.7e-21),
        (units.SURFACE_ENERGY, "4.7e-3 J/m^2", 4.7e-3),
        (units.SURFACE_ENERGY, "4.7 mN/m", 4.7e-3),
        (units.RATE, "1e4 1/s", 1e4),
        (units.RATE, "1e4/s", 1e4),
        (units.RATE, "60 1/min", 1.0),
        (units.TEMPERATURE, "25 degC", 298.15),
        (units.INVERSE_LENGTH, "0.1 1/nm", 1e8),
        (units.DIMENSIONLESS, "0.01 %", 1e-4),
        (units.DIMENSIONLESS, 3, 3.0),
    ],
)
def test_reads_exactly_the_number_that_is_meant(quantity, text, value):
    assert quantity.to_si(text) == value


@given(st.floats(1e-30, 1e30), st.sampled_from(["nm", "um", "m"]))
def test_any_length_survives_to_the_last_digit(value, unit):
    expected = value * {"nm": 1e-9, "um": 1e-6, "m": 1.0}[unit]
    assert units.LENGTH.to_si(f"{value!r} {unit}") == pytest.approx(expected, rel=3e-16)


@given(st.text(max_size=12))
def test_no_text_crashes_the_reader(text):
    for quantity in (units.LENGTH, units.DIMENSIONLESS):
        try:
            assert math.isfinite(quantity.to_si(text))
        except ValueError as refused:
            assert "expected a" in str(refused)


# The listing of keys is that of the models.


def test_every_key_is_described():
    listed = describe()
    tables = {key.table for key in listed}
    assert {
        "suspension",
        "flow",
        "effects.van_der_waals",
        "effects.jkr",
        "hydrodynamics",
        "numerics",
    } <= tables
    undocumented = [f"{key.table}.{key.key}" for key in listed if not key.meaning]
    assert not undocumented


def test_listed_defaults_are_those_in_force():
    flow = "[flow]\nshear_rate = '1 1/s'\nviscosity = '1 cP'\n"
    text = f"[suspension]\nradius = '500 nm'\nvolume_fraction = 1e-4\n{flow}"
    unstated = ("required", "none", "absent", "from the others", "")
    stated = [
        f"{key.table}.{key.key} = {key.default}"
        for key in describe()
        if key.default not in unstated and key.table.split(".")[0] not in ("flow", "effects")
    ]
    assert len(stated) > 10
    assert Scene.from_text("\n".join([*stated, text])) == Scene.from_text(text)

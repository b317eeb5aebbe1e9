"""Scenes with earlier names: refused in a file, with the new name; read from a dataset."""

import pytest

import mcdem
from mcdem.errors import SceneError
from mcdem.quantities.renamed_keys import KEYS, VALUES
from mcdem.scene import Scene

TEXT = """
[suspension]
radius = "500 nm"
volume_fraction = 1e-4
[flow]
shear_rate = "1e4 1/s"
viscosity = "100 cP"
"""

OLD = """
[hydrodynamics]
cutoff_reading = "gap"
[numerics]
scheme = "paper"  # as printed
pair_selection = "inversion"
far_field_lag = 0.1
paper_close_gap = 0.5
end_inert = false
"""


@pytest.mark.parametrize("old, new", KEYS.items())
def test_a_key_of_before_is_refused_with_its_new_name(old, new):
    table, _, key = old.rpartition(".")
    with pytest.raises(SceneError) as said:
        Scene.from_text(f"{TEXT}[{table}]\n{key} = 1\n", "here.toml")
    assert len(str(said.value).splitlines()) == 1
    assert f'[{table}] key "{key}" is now' in str(said.value) and new.rpartition(".")[2] in str(said.value)


@pytest.mark.parametrize("place, new", VALUES.items())
def test_a_value_of_before_is_refused_with_its_new_name(place, new):
    (_, value), (table, _, key) = place, place[0].rpartition(".")
    with pytest.raises(SceneError, match=f'{key} = "{value}" is now "{new}"'):
        Scene.from_text(f'{TEXT}[{table}]\n{key} = "{value}"\n', "here.toml")


def test_a_dataset_of_before_is_read():
    scene = Scene.from_dataset(TEXT + OLD)
    assert scene.numerics.scheme == "explicit_euler" and scene.numerics.event_selection == "inverse_transform"
    assert scene.numerics.implicit.far_field_tolerance == 0.1
    assert scene.numerics.explicit_euler.close_gap == 0.5
    assert not scene.numerics.end_stable and scene.hydrodynamics.cutoff_convention == "gap"
    assert "# as printed" in scene.text and Scene.from_text(scene.text) == scene


def test_a_scene_of_now_keeps_its_text():
    assert Scene.from_dataset(TEXT).text == TEXT and mcdem.Scene is Scene

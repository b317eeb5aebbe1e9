"""A trajectory survives its file, and independent libraries read the same numbers."""

import numpy as np
import pytest
import xarray as xr
from trimer import RATE, A, turning_trimer

from mcdem.encounter import trajectory
from mcdem.errors import DataFileError


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("trajectory") / "encounter.nc"
    trajectory.write(turning_trimer(), path)
    return path


def test_file_gives_back_what_it_was_given(written):
    given, back = turning_trimer(), trajectory.read(written)
    np.testing.assert_allclose(back.positions, given.positions, rtol=1e-14, atol=1e-21)
    np.testing.assert_allclose(back.time, given.time, rtol=1e-14)
    np.testing.assert_array_equal(back.tension, given.tension)
    assert back.parent.tolist() == [0, 0, 1]
    assert (back.radius, back.shear_rate, back.pull_off_force) == (A, RATE, 1.107e-8)
    assert back.origin["outcome"] == "parted"


def test_bonds_and_fields_of_a_frame():
    t = turning_trimer()
    pairs, tension = t.bonds(4)
    assert pairs.tolist() == [[0, 1], [0, 2]]
    assert tension[1] == 5e-9
    assert t.coordination_number[4].tolist() == [2, 1, 1]
    assert t.coordination_number[0].tolist() == [1, 1, 0]
    assert t.largest_tension[4, 2] == 5e-9 and t.largest_tension[0, 2] == 0.0
    np.testing.assert_allclose(t.strain[-1], 1.6)


def test_plain_xarray_opens_it(written):
    with xr.open_dataset(written, decode_times=False) as data:
        assert data.attrs["Conventions"] == "AMBER"
        np.testing.assert_allclose(data["coordinates"].values * 1e-10, turning_trimer().positions, atol=1e-20)
        assert data["coordinates"].attrs["units"] == "angstrom"
        assert data["largest_tension"].dims == ("frame", "atom")


def test_in_memory_dataset_is_si():
    data = turning_trimer().to_xarray()
    assert data["position"].attrs["units"] == "m"
    assert float(abs(data["position"]).max()) < 1e-4


def test_ovito_reads_positions_and_fields(written):
    pytest.importorskip("ovito", reason="OVITO's Python package does not load", exc_type=ImportError)
    from ovito.io import import_file

    pipeline = import_file(str(written))
    given = turning_trimer()
    assert pipeline.source.num_frames == given.frames
    for k in (0, 4, given.frames - 1):
        seen = pipeline.compute(k).particles
        np.testing.assert_allclose(seen.positions[...] * 1e-10, given.positions[k], rtol=1e-6, atol=1e-13)
        np.testing.assert_array_equal(seen["coordination_number"][...], given.coordination_number[k])
        np.testing.assert_allclose(seen["largest_tension"][...], given.largest_tension[k], rtol=1e-6)
        np.testing.assert_allclose(seen["Radius"][...] * 1e-10, A, rtol=1e-6)


def test_mdanalysis_reads_it_as_amber(written):
    mda = pytest.importorskip("MDAnalysis", reason="MDAnalysis is not installed", exc_type=ImportError)
    given = turning_trimer()
    universe = mda.Universe.empty(3, trajectory=False)
    universe.load_new(str(written), format="NCDF")
    assert len(universe.trajectory) == given.frames
    for k, frame in enumerate(universe.trajectory):
        np.testing.assert_allclose(frame.positions * 1e-10, given.positions[k], rtol=1e-6, atol=1e-13)
        np.testing.assert_allclose(frame.time * 1e-12, given.time[k], rtol=1e-6, atol=1e-12)


def test_ase_reads_extended_xyz(tmp_path):
    ase_io = pytest.importorskip("ase.io", reason="ASE is not installed")
    given = turning_trimer()
    trajectory.write_extended_xyz(given, tmp_path / "encounter.xyz")
    frames = ase_io.read(tmp_path / "encounter.xyz", index=":", format="extxyz")
    assert len(frames) == given.frames
    for k, frame in enumerate(frames):
        np.testing.assert_allclose(frame.positions * 1e-10, given.positions[k], rtol=1e-7, atol=1e-16)
        assert frame.arrays["parent"].tolist() == [0, 0, 1]
        np.testing.assert_array_equal(frame.arrays["coordination_number"], given.coordination_number[k])
        np.testing.assert_allclose(
            frame.arrays["largest_tension_nN"] * 1e-9, given.largest_tension[k], rtol=1e-5
        )
        np.testing.assert_allclose(frame.info["Time"], given.time[k], rtol=1e-8)


def test_ovito_reads_extended_xyz(tmp_path):
    pytest.importorskip("ovito", reason="OVITO's Python package does not load", exc_type=ImportError)
    from ovito.io import import_file

    given = turning_trimer()
    trajectory.write_extended_xyz(given, tmp_path / "encounter.xyz")
    pipeline = import_file(str(tmp_path / "encounter.xyz"))
    assert pipeline.source.num_frames == given.frames
    np.testing.assert_allclose(
        pipeline.compute(4).particles.positions[...] * 1e-10, given.positions[4], rtol=1e-6, atol=1e-13
    )


def test_meshio_reads_vtk(tmp_path):
    meshio = pytest.importorskip("meshio", reason="meshio is not installed")
    given = turning_trimer()
    files = trajectory.write_vtk(given, tmp_path / "frames")
    assert len(files) == given.frames
    mesh = meshio.read(files[4])
    np.testing.assert_allclose(mesh.points * 1e-6, given.positions[4], rtol=1e-8, atol=1e-16)
    cells = {block.type: block.data.tolist() for block in mesh.cells}
    assert cells["line"] == [[0, 1], [0, 2]]
    tension = dict(zip((b.type for b in mesh.cells), mesh.cell_data["tension_nN"], strict=True))["line"]
    np.testing.assert_allclose(np.ravel(tension), 1e9 * given.bonds(4)[1], rtol=1e-6)


def test_other_files_are_refused(tmp_path):
    (tmp_path / "no.nc").write_text("not NetCDF")
    with pytest.raises(DataFileError, match="cannot be read as NetCDF"):
        trajectory.read(tmp_path / "no.nc")
    xr.Dataset({"x": ("t", [1.0])}).to_netcdf(tmp_path / "other.nc")
    with pytest.raises(DataFileError, match="not an encounter's trajectory"):
        trajectory.read(tmp_path / "other.nc")
    assert not trajectory.is_trajectory(tmp_path / "other.nc")

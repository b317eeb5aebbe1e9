"""A compressed dataset is smaller, says the same within its digits, and is continued bit for bit."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic
import xarray as xr
from typer.testing import CliRunner

from mcdem.analysis.dataset import RunDataset
from mcdem.commands.main import app
from mcdem.errors import DataFileError, UserError
from mcdem.monte_carlo.comparison import differences
from mcdem.monte_carlo.compress import DIGITS, OF_EVENTS, OF_MISSES, POSITION, compress, rounded
from mcdem.monte_carlo.record import event_columns, opened
from mcdem.monte_carlo.run_control import run
from mcdem.netcdf.compact_events import compacted, expanded, replaced
from mcdem.netcdf.whole_files import FILES

SCENE = synthetic.scene(population__initial=40, run__snapshot_every="50 ms")


def follow(path, events, **options):
    return run(SCENE, path, events=events, encounter=synthetic.aggregation_and_breakup, **options)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """400 encounters, with seven snapshots or more."""
    path = tmp_path_factory.mktemp("thinning") / "whole.nc"
    follow(path, 400, seed=5)
    return path


@pytest.fixture(scope="module")
def small(whole):
    path = whole.with_name("small.nc")
    compress(whole, path, every=0.2)
    return path


def test_it_is_smaller_and_says_so(whole, small):
    assert small.stat().st_size < 0.5 * whole.stat().st_size
    assert "compressed: reals to 12 significant bits" in xr.open_dataset(small).attrs["history"]


def test_numbers_of_the_history_keep_their_digits(whole, small):
    full, kept = RunDataset(whole), RunDataset(small)
    missed = full.outcome == "missed"
    assert 0.1 < missed.mean() < 0.9
    for a_table, b_table in ((full.series, kept.series), (full.events, kept.events)):
        assert set(a_table) == set(b_table)
        for name in a_table.variables:
            a, b = a_table[name].values, b_table[name].values
            assert (a.dtype, a_table[name].dims) == (b.dtype, b_table[name].dims), name
            assert {k: np.asarray(v).tolist() for k, v in a_table[name].attrs.items()} == {
                k: np.asarray(v).tolist() for k, v in b_table[name].attrs.items()
            }, name
            if a.dtype.kind != "f":
                assert (a == b).all(), name
                continue
            bits = OF_EVENTS.get(name, DIGITS) if "event" in a_table[name].dims else DIGITS
            if name == "smallest_gap":
                assert np.isnan(b[missed]).all()
                a, b = a[~missed], b[~missed]
            elif name in OF_MISSES:
                np.testing.assert_allclose(b[missed], a[missed], rtol=1.1 * 2.0 ** -OF_MISSES[name])
                a, b = a[~missed], b[~missed]
            np.testing.assert_allclose(b, a, rtol=2.0**-bits, err_msg=name)
    assert (np.diff(kept.events["time"].values) > 0).all()


def test_a_log_in_few_bytes_is_given_back_bit_for_bit(whole):
    """Serial numbers newer, older and of earlier versions; values that change between appearances; no products, none at all."""
    with opened(whole) as (file,):
        of_run = {name: column.values for name, column in event_columns(file).items()}
    strange = {name: values.copy() for name, values in of_run.items()}
    strange["product_serial"][::7] += 1000
    strange["product_serial"][3::11] -= 5
    strange["parent_aspect_ratio"][::3, 1] = np.nan
    strange["parent_outer_radius"][5:9] *= -1.0
    none = {name: values[:0] for name, values in of_run.items()}
    lost = none | {name: v[:4] for name, v in of_run.items() if not name.startswith("product_")}
    lost["number_of_products"] = np.zeros(4, np.int64)
    older = {
        name: values for name, values in of_run.items() if "aspect" not in name and "gyration" not in name
    }
    for columns in (of_run, strange, none, lost, older):
        gone = replaced(columns)
        stored = {name: values for name, values in columns.items() if name not in gone}
        stored |= {name: values for name, (_, _, values) in compacted(columns).items()}
        again = expanded(stored, columns["time"])
        assert set(again) == set(columns)
        for name, values in columns.items():
            assert again[name].dtype == values.dtype, name
            assert again[name].tobytes() == np.ascontiguousarray(values).tobytes(), name


def test_compressed_twice_is_compressed_once(small, tmp_path):
    compress(small, tmp_path / "again.nc")
    assert differences(small, tmp_path / "again.nc") == []
    assert abs((tmp_path / "again.nc").stat().st_size / small.stat().st_size - 1) < 0.05


def test_snapshots_are_those_asked_for_with_their_aggregates(whole, small):
    full, kept = RunDataset(whole), RunDataset(small)
    chosen = np.flatnonzero(np.isin(full.snapshot_times.round(6), kept.snapshot_times.round(6)))
    assert 4 <= len(kept.snapshot_times) == len(chosen) < len(full.snapshot_times)
    assert np.diff(kept.snapshot_times)[:-2] == pytest.approx(0.2)
    assert kept.snapshot_times[-2:] == pytest.approx(full.snapshot_times[-2:], rel=1e-7)
    for here, there in enumerate(chosen):
        for a, b in zip(kept.aggregates(here), full.aggregates(int(there)), strict=True):
            assert (a.bonds == b.bonds).all()
            np.testing.assert_allclose(a.positions, b.positions, rtol=0, atol=2.0**-POSITION * kept.radius)


def test_the_process_goes_on_bit_for_bit(whole, small, tmp_path):
    ends = []
    for name, path in (("long", whole), ("short", small)):
        copy = tmp_path / f"{name}.nc"
        copy.write_bytes(path.read_bytes())
        follow(copy, 700, resume=True)
        with xr.open_dataset(copy, group="events", decode_times=False) as events:
            first = int(events["number_of_products"][:400].sum())
            new = events.isel(event=slice(400, None), product=slice(first, None))
            ends.append(new.drop_vars("cpu_time").load())
    for name in ends[0].variables:
        np.testing.assert_array_equal(ends[1][name].values, ends[0][name].values, err_msg=name)
    # The state at the end is that of the run that was never compressed; snapshots fall due at the same moments.
    assert {d.split(":")[0] for d in differences(tmp_path / "long.nc", tmp_path / "short.nc")} <= {
        *(f"/{name}" for name in xr.open_dataset(small).variables),
        *(f"/events/{name}" for name in ends[0].variables),
        *(f"/snapshots/{name}" for name in xr.open_dataset(small, group="snapshots").variables),
    }
    assert "compressed" in xr.open_dataset(tmp_path / "short.nc").attrs["history"]
    long, short = (RunDataset(tmp_path / f"{name}.nc") for name in ("long", "short"))
    assert (long.snapshot_times[-1], *long.snapshot_times[-4:-1].round(9)) == (
        short.snapshot_times[-1],
        *short.snapshot_times[-4:-1].round(9),
    )
    for a, b in zip(long.aggregates(), short.aggregates(), strict=True):
        assert (a.positions == b.positions).all()


def test_rounding_is_to_significant_bits():
    values = np.array([0.0, 1.0, -1.0 - 2.0**-13, 3.0e-9, np.inf, np.nan, 1e300])
    found = rounded(values, 12)
    assert found[:2].tolist() == [0.0, 1.0]
    assert found[2] == -1.0
    np.testing.assert_allclose(found[[3, 6]], values[[3, 6]], rtol=2.0**-12)
    assert found[4] == np.inf
    assert np.isnan(found[5])
    assert (rounded(found, 12)[:5] == found[:5]).all()


def test_what_cannot_be_compressed_is_refused(whole, tmp_path):
    with pytest.raises(DataFileError, match="another name"):
        compress(whole, whole)
    with pytest.raises(UserError, match="above 0"):
        compress(whole, tmp_path / "a.nc", every=0.0)
    (tmp_path / "foreign.nc").write_text("no dataset")
    with pytest.raises(DataFileError, match="mcdem run"):
        compress(tmp_path / "foreign.nc", tmp_path / "a.nc")
    assert not (tmp_path / "a.nc").exists()


def test_a_file_that_a_run_is_writing_is_not_replaced(whole, tmp_path):
    with FILES.locked(tmp_path / "busy.nc"), pytest.raises(DataFileError, match="another run"):
        compress(whole, tmp_path / "busy.nc")


def test_a_damaged_dataset_is_refused(whole, tmp_path):
    content = bytearray(whole.read_bytes())
    for place in range(len(content) // 4, 3 * len(content) // 4, 997):
        content[place] ^= 0xFF
    (tmp_path / "damaged.nc").write_bytes(bytes(content))
    with pytest.raises(DataFileError):
        compress(tmp_path / "damaged.nc", tmp_path / "a.nc")


def test_a_dataset_of_before_histories_gets_one(tmp_path):
    compress("tests/monte_carlo/run_of_before.nc", tmp_path / "a.nc", every=5.0)
    first, last = xr.open_dataset(tmp_path / "a.nc").attrs["history"].splitlines()
    assert "until then" in first and "compressed" in last


def test_the_command(whole, tmp_path):
    target = tmp_path / "small.nc"
    runner = CliRunner()
    said = runner.invoke(app, ["compress", str(whole), "-o", str(target), "--every", "100 ms"])
    assert said.exit_code == 0, said.output
    assert "MiB of" in said.output
    again = runner.invoke(app, ["compress", str(whole), "-o", str(target)])
    assert again.exit_code == 2
    assert "exists" in again.output
    wrong = runner.invoke(app, ["compress", str(whole), "-o", str(tmp_path / "b.nc"), "--every", "5 m"])
    assert wrong.exit_code == 2
    assert "--every" in wrong.output

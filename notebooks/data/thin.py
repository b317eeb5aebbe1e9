"""Keep of a run what a comparison with a balance needs: every 20th row of the series, and the sizes in its snapshots.

python notebooks/data/thin.py RUN.nc THINNED.nc
"""

import re
import sys

import numpy as np
import xarray as xr

source, target = sys.argv[1:]
with xr.open_dataset(source, decode_times=False) as root:
    rows = np.union1d(np.arange(0, root.sizes["row"], 20), root.sizes["row"] - 1)
    series = root.isel(row=rows).load()
    series.attrs["title"] += "; thinned: every 20th row, sizes in snapshots"
    # File names say as much without the folders of one machine.
    series.attrs["command"] = re.sub(r"/\S*/", "", root.command)
with xr.open_dataset(source, group="snapshots", decode_times=False) as group:
    snapshots = group[["time", "number_of_aggregates", "size"]].load()
pack = {"zlib": True, "complevel": 9}
series.to_netcdf(target, encoding={name: pack for name in series.data_vars})
snapshots.to_netcdf(
    target, mode="a", group="snapshots", encoding={name: pack for name in snapshots.data_vars}
)

#!/usr/bin/env bash
# Makes the data of the notebooks: runs of the paper's suspension, compressed, and what is derived from them.
#
#     bash notebooks/data/make.sh WORK [STEP...]        steps: runs edges changed sensitivity tables atlas paper_scheme; all by default
#
# Whole runs and tables go to the folder WORK and are continued from there, so it may be stopped at any time and called again;
# results go to WORK/data. Two runs at a time need about four hours in all; JOBS=8 makes it eight at a time.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
scenes=$(cd "$here/../../scenes" && pwd)
work=${1:?where the whole runs go}
shift
all='runs edges changed sensitivity tables atlas paper_scheme'
steps=${*:-$all}
for step in $steps; do
    [[ " $all " == *" $step "* ]] || { echo "no step $step; expected some of: $all" >&2; exit 2; }
done
command -v mcdem >/dev/null || { echo "mcdem is not on the path: activate the environment it is installed in" >&2; exit 2; }
mkdir -p "$work/data"
cd "$work"
export OPENBLAS_NUM_THREADS=1

# name, stress [Pa], primaries at the start, seed, until [s]
runs='
run-1000Pa 1000 200 1 130
run-1000Pa-of-100-seed-2 1000 100 2 120
run-750Pa-of-100 750 100 1 108
run-875Pa-of-100 875 100 1 135
run-1250Pa 1250 200 1 150
run-1500Pa-of-100 1500 100 1 200
'
# name, viscosity [cP], until [s]: stresses below and above, of which the atlas alone takes the counts
edges='
run-600Pa-of-100 60 26.2
run-2000Pa-of-100 200 126.3
'
# name, the key of the scene that is switched (a sed expression)
changed='
as-given s/^$//
frozen-shapes s/^doubling_below/restructuring=false\n&/
cutoff-1e-2 s/^lubrication_cutoff.*/lubrication_cutoff=1e-2/
cutoff-2e-3 s/^lubrication_cutoff.*/lubrication_cutoff=2e-3/
rotations-32 s/^rotations.*/rotations=32/
'

follow() { # scene, run, seed, until
    mcdem run "$1" -o "$2" --seed "$3" --until "$4 s" --resume --workers 1
}
export -f follow

if [[ $steps == *runs* ]]; then
    grep . <<<"$runs" | while read -r name stress initial seed until; do
        sed "s/^initial = .*/initial = $initial/" "$scenes/paper-${stress}Pa.toml" >"$name.toml"
        echo "$name.toml $name.nc $seed $until"
    done | xargs -P "${JOBS:-2}" -L 1 bash -c 'follow "$@"' follow
    grep . <<<"$runs" | while read -r name _; do
        mcdem compress "$name.nc" -o "data/$name.nc" --every "5 s" --overwrite
    done
fi

if [[ $steps == *edges* ]]; then
    grep . <<<"$edges" | while read -r name viscosity until; do
        sed -e "s/^initial = .*/initial = 100/" -e "s/^viscosity.*/viscosity = \"$viscosity cP\"/" "$scenes/paper-1000Pa.toml" >"$name.toml"
        echo "$name.toml $name.nc 1 $until"
    done | xargs -P "${JOBS:-2}" -L 1 bash -c 'follow "$@"' follow
fi

if [[ $steps == *changed* ]]; then
    grep . <<<"$changed" | while read -r name change; do
        sed -e "s/^initial = .*/initial = 60/" -e "$change" "$scenes/paper-1000Pa.toml" >"$name.toml"
        echo "$name.toml $name.nc 1 60"
    done | xargs -P "${JOBS:-2}" -L 1 bash -c 'follow "$@"' follow
    python "$here/../../benchmarks/late_populations.py" {as-given,cutoff-1e-2,cutoff-2e-3,frozen-shapes,rotations-32}.nc \
        run-1000Pa.nc run-1000Pa-of-100-seed-2.nc --between 36 60 -o data/changed-1000Pa.csv
fi

cd data
if [[ $steps == *sensitivity* ]]; then
    of_groups=(
        --set "effects.van_der_waals.minimum_approach=0.3 nm"
        --set "effects.van_der_waals.hamaker_constant=2e-20 J"
        --set "effects.jkr.elastic_modulus=13.6 GPa"
    )
    mcdem sensitivity "$scenes/paper-1000Pa.toml" --from run-1000Pa.nc --encounters 1000 --seed 1 -o sensitivity-1000Pa.png --overwrite \
        --set hydrodynamics.lubrication_cutoff=2e-3,1e-2 \
        --set "effects.van_der_waals.london_wavelength=200 nm,none" \
        --set numerics.rotations=1,32 --set numerics.implicit.max_step=0.1 \
        "${of_groups[@]}"
    for stress in 750 875 1250 1500; do # for the tables: what a group that differs does to their outcomes
        run=run-${stress}Pa.nc
        [[ -e $run ]] || run=run-${stress}Pa-of-100.nc
        mcdem sensitivity "$scenes/paper-${stress}Pa.toml" --from "$run" --encounters 600 --seed 1 \
            -o "sensitivity-${stress}Pa.png" --overwrite \
            --set "effects.van_der_waals.london_wavelength=200 nm" "${of_groups[@]}"
    done
fi

if [[ $steps == *tables* ]]; then
    for stress in 750 875 1000 1250 1500; do
        run=run-${stress}Pa.nc # the second run at 1000 Pa is left to compare with
        [[ -e $run ]] || run=run-${stress}Pa-of-100.nc
        mcdem kernels "$scenes/paper-${stress}Pa.toml" --from "$run" -o "../kernels-${stress}Pa.nc" \
            --encounters 400 --sensitivity sensitivity-${stress}Pa.csv --workers 1 --overwrite
        python -c '
import sys
from mcdem.kernel_tables.runs import only_designed
from pbekit.tables.kernel_table import KernelTable
only_designed(KernelTable.load(sys.argv[1])).save(sys.argv[2])' "../kernels-${stress}Pa.nc" "designed-${stress}Pa.nc"
    done
fi

if [[ $steps == *atlas* ]]; then
    # pbekit/tables/atlas.nc: counts of every run, over cohesion number and sizes
    rm -f ../atlas.nc
    for run in run-*.nc; do
        stress=${run#run-} stress=${stress%%Pa*}
        mcdem kernels "$scenes/paper-${stress}Pa.toml" --from "$run" --into ../atlas.nc
    done
    for stress in 600 2000; do
        (cd .. && mcdem kernels "run-${stress}Pa-of-100.toml" --from "run-${stress}Pa-of-100.nc" --into atlas.nc)
    done
fi

if [[ $steps == *paper_scheme* ]]; then
    python "$here/../../benchmarks/paper_scheme.py" run-1000Pa.nc -o paper-scheme-1000Pa.csv
fi

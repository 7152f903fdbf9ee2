#!/bin/bash
# A rubber whose module snaps: the table ends before the fold, and commands beyond are answered at its edge, with a warning,
# no fault and no snap.
build=${TRIBEND_BUILD:-build}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
table=$scratch/fold.tbt
passed=0 failed=0
"$build/tribend-tables" build paper-semicircle --material ecoflex-0030-measured-ogden --nodes 9 --mesh-size 1.5mm -q -o "$table" >"$scratch/said" || cat "$scratch/said"

# check NAME WORDS command...: exit code 0, and the words in what it says
check() {
    local name=$1 words=$2
    shift 2
    echo "[ RUN      ] $name"
    if "$@" >"$scratch/said" 2>&1 && grep -qE "$words" "$scratch/said"; then
        echo "[       OK ] $name"
        passed=$((passed + 1))
    else
        cat "$scratch/said"
        echo "[  FAILED  ] $name"
        failed=$((failed + 1))
    fi
}
check table_knows_the_limit_point 'chamber 1 alone balloons at 7[0-9]{3} Pa' "$build/tribend-tables" show "$table"
both=$scratch/both.tbt
"$build/tribend-tables" build paper-circle --material ecoflex-0030-c30-positive --nodes 4 --mesh-size 1.5mm -q -o "$both" >"$scratch/said" || cat "$scratch/said"
check table_has_both_stable_branches 'balloons at 3[12][0-9]{2} Pa; it falls back at (29|30)[0-9]{2} Pa' "$build/tribend-tables" show "$both"
check bend_inside 'warnings +none' "$build/tribend" bend 8deg --for 3s -q --table "$table"
# next to the fold a few pascals of a sensor's noise bend the module by degrees: a gap of the body may be seen, none of a valve
for toward in 0 30 75 180; do
    check "bend_beyond_toward_$toward" 'warnings +the command was out of reach: the nearest reachable one is followed(, gap between module and model in body: .*)?$' "$build/tribend" bend 60deg --toward "${toward}deg" --for 3s -q --table "$table"
done
# At the table's end the chambers are as soft as they get and the noise is as it falls: no fault, and the direction that was asked for.
beyond() { # SEED TOWARD-DEG
    "$build/tribend" bend 60deg --toward "$2deg" --for 3s -q --table "$table" --seed "$1" >"$scratch/beyond" 2>&1 &&
        grep -q 'warnings *the command was out of reach' "$scratch/beyond" &&
        awk -v toward="$2" '/^direction/ { off = $2 - toward; seen = 1 } END { exit !(seen && off < 4 && off > -4) }' "$scratch/beyond"
}
for seed in {2..9}; do
    for toward in 30 180; do
        beyond "$seed" "$toward" || { echo "seed $seed toward $toward"; cat "$scratch/beyond"; wrong=1; }
    done
done
check whatever_the_noise sound bash -c 'test -z "$1" && echo sound' - "${wrong:-}"
check pressure_beyond 'out of reach' "$build/tribend" pressure 100mbar 0mbar 0mbar --for 3s -q --table "$table"
check pressures_beyond 'out of reach' "$build/tribend" pressure 100mbar 100mbar 50mbar --for 3s -q --table "$table"
echo "[  PASSED  ] $passed test(s)."
[ "$failed" -eq 0 ]

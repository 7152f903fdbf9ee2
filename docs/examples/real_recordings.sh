#!/bin/bash
# Diagnose the public recordings of two real modules, and print what docs/gap.md ("Real recordings") shows.
#
#   docs/examples/real_recordings.sh DATA [OUT]
#
# DATA holds kcl_stiff_flop/{NoLoad,Load1}.csv and eth_sopra_steps/NNNmbar_V3.csv; OUT (default build/real) gets tables, run
# logs and reports. TRIBEND_BUILD: where the programs are (default build). It stops at the first command that fails.
set -euo pipefail
data=${1:?usage: real_recordings.sh DATA [OUT]}
out=${2:-build/real}
build=${TRIBEND_BUILD:-build}
mkdir -p "$out"

table() { # module
    [ -s "$out/$1.tbt" ] || "$build/tribend-tables" build "tables/modules/$1.yaml" --nodes 9 --mesh-size 1.5mm -q -o "$out/$1.tbt" >/dev/null
}
diagnose() { # name, module, logs
    local name=$1 module=$2
    shift 2
    "$build/tribend" gap diagnose "$@" --module "$module" --table "$out/$module.tbt" --json "$out/$name.json" \
        --html "$out/$name.html" >"$out/$name.txt" 2>"$out/$name.progress"
    echo "== $name"
    grep -E '^(verdict|where|which|closest|nominal|how far|direction)|^ +r[123]_|^ +[0-9]+ % closed' "$out/$name.txt"
}

table stiff-flop
table eth-arm
for name in NoLoad Load1; do
    "$build/tribend" import "$data/kcl_stiff_flop/$name.csv" --mapping kcl_stiff_flop -o "$out/$name.csv" >/dev/null
    diagnose "kcl-$name" stiff-flop "$out/$name.csv"
done
steps=()
for mbar in 100 150 200 250 300 350 400 450; do
    "$build/tribend" import "$data/eth_sopra_steps/${mbar}mbar_V3.csv" --mapping eth_sopra_steps --set "p1_cmd_pa=${mbar}mbar" \
        -o "$out/$mbar.csv" >/dev/null
    steps+=("$out/$mbar.csv")
done
diagnose eth-steps eth-arm "${steps[@]}"

#!/bin/bash
# A few seconds of each fuzz target, and every input that broke something before. `make fuzz` runs them for longer.
build=${TRIBEND_BUILD:-build}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
. tests/support/check.sh
shown="$scratch/*.txt"
make -s -j"$(nproc)" BUILD="$build" fuzz-programs >"$scratch/make.txt" 2>&1
check fuzz_targets_build $?
for target in frames tip_stream table parameters; do
    tests/fuzz/run "$build" 3 "$target" >"$scratch/$target.txt" 2>&1
    check "nothing_found_in_$target" $?
done
# more than the seeds alone are reached, or the run would prove nothing
awk '{if ($2 < 20 || $4 < 60) bad = 1} END {exit bad || NR != 4}' "$scratch"/{frames,tip_stream,table,parameters}.txt
check each_target_ran $?
tests/fuzz/run "$build" 1 nothing >/dev/null 2>&1
[ $? -eq 2 ]
check a_target_that_is_none_is_refused $?
check_end

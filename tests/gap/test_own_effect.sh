#!/bin/bash
# The documented example of an effect of one's own: one file, built in from outside hal/sim, is listed, acts, and is found by
# the diagnosis where it is present and only there.
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
build=$scratch/build
. tests/support/check.sh
shown=$scratch/said
cp docs/examples/joint_slack.c "$scratch/joint_slack.c"
make -s -j2 BUILD="$build" EXTRA_EFFECTS="$scratch/joint_slack.c" "$build/tribend" >"$scratch/said" 2>&1
check one_file_is_built_in $?
"$build/tribend" effects >"$scratch/said" 2>&1 && grep -q '^joint_slack' "$scratch/said"
check it_is_listed $?
TRIBEND_TABLE=$PWD/tables/paper-semicircle.tbt
export TRIBEND_TABLE
for toward in 20 200; do
    "$build/tribend" bend 55deg --toward ${toward}deg --for 8s -q --effect joint_slack:slack=0.08 \
        --record "$scratch/slack-$toward.csv" >"$scratch/said" 2>&1
done
"$build/tribend" gap diagnose "$scratch"/slack-*.csv >"$scratch/said" 2>&1 && grep -q '^which     joint_slack' "$scratch/said"
check it_is_found_where_it_is $?
"$build/tribend" bend 55deg --toward 20deg --for 8s -q --record "$scratch/plain.csv" >"$scratch/said" 2>&1
"$build/tribend" gap diagnose "$scratch/plain.csv" >"$scratch/said" 2>&1 && ! grep -q 'joint_slack' "$scratch/said"
check and_only_there $?
check_end

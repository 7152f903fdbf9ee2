#!/bin/bash
# One table from one rank, from two, and from two of which one is killed in mid-sweep and started again: the same bytes.
build=${TRIBEND_BUILD:-build}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_btl_vader_single_copy_mechanism=none
ranks="mpirun -n 2"
[ "$(id -u)" = 0 ] && ranks="$ranks --allow-run-as-root"
table="$build/tribend-tables build paper-semicircle --nodes 7 --mesh-size 1.5mm"
passed=0 failed=0

# check NAME command...: the command must succeed
check() {
    local name=$1
    shift
    echo "[ RUN      ] $name"
    if "$@" >"$scratch/said" 2>&1; then
        echo "[       OK ] $name"
        passed=$((passed + 1))
    else
        cat "$scratch/said"
        echo "[  FAILED  ] $name"
        failed=$((failed + 1))
    fi
}

# Starts two ranks, kills rank 1 with no warning once a slab is in the file of points: the run must fail, the file stay.
kill_one_rank() {
    $ranks $table --resume -q -o "$scratch/killed.tbt" &
    local mpirun=$! victim="" size=0
    for _ in $(seq 600); do
        size=$(stat -c %s "$scratch/killed.tbt.points" 2>/dev/null || echo 0)
        [ "$size" -gt 100 ] && break
        sleep 0.02
    done
    for process in /proc/[0-9]*; do
        if tr '\0' '\n' <"$process/environ" 2>/dev/null | grep -qx OMPI_COMM_WORLD_RANK=1 &&
            tr '\0' ' ' <"$process/cmdline" 2>/dev/null | grep -q "$scratch"; then
            victim=${process#/proc/}
        fi
    done
    [ -n "$victim" ] || { echo "rank 1 was not found"; return 1; }
    kill -9 "$victim"
    ! wait "$mpirun" && [ ! -e "$scratch/killed.tbt" ] && [ "$(stat -c %s "$scratch/killed.tbt.points")" -ge "$size" ]
}
resume() {
    $ranks $table --resume -o "$scratch/killed.tbt" && cmp "$scratch/one.tbt" "$scratch/killed.tbt" &&
        [ ! -e "$scratch/killed.tbt.points" ]
}
# A file of points of another module is refused, and stays as it is.
of_another_module() {
    printf 'TBSWEEP1 some other job' >"$scratch/other.tbt.points"
    ! $table --resume -q -o "$scratch/other.tbt" 2>"$scratch/words" && grep -q 'another job' "$scratch/words" &&
        [ "$(cat "$scratch/other.tbt.points")" = 'TBSWEEP1 some other job' ]
}
# A record cut short by a kill is dropped, the sound ones before it are used.
cut_short() {
    cp "$scratch/points" "$scratch/cut.tbt.points" && truncate -s -5 "$scratch/cut.tbt.points" &&
        $table --resume -q -o "$scratch/cut.tbt" && cmp "$scratch/one.tbt" "$scratch/cut.tbt"
}

check one_rank $table -q -o "$scratch/one.tbt"
check two_ranks $ranks $table -q -o "$scratch/two.tbt"
check two_ranks_same_bytes cmp "$scratch/one.tbt" "$scratch/two.tbt"
check one_rank_killed kill_one_rank
cp "$scratch/killed.tbt.points" "$scratch/points"
check resumed_same_bytes resume
check cut_record_is_dropped cut_short
check points_of_another_module of_another_module
echo "[  PASSED  ] $passed test(s)."
[ "$failed" -eq 0 ]

#!/bin/bash
# Half a dozen blind cases through `tribend gap diagnose`: each gets an answer, and no measure is surely missed.
build=${TRIBEND_BUILD:-build}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
. tests/support/check.sh
export SMALL=1 STRICT=1 BUILD=$build
tests/gap/blind/gap_check "$scratch/work" >"$scratch/said" 2>&1
code=$?
cat "$scratch/said"
! grep -q 'no answer' "$scratch/said"
check every_case_gets_an_answer $?
[ "$code" -eq 0 ]
check no_measure_is_surely_missed $?
grep -qE '^gap plan: its experiment halves the group .* of +[1-9]' "$scratch/said"
check plans_are_followed_and_scored $?

# Two ranks, of which the whole job is killed once a case is diagnosed and started again: the same answers, the same score.
unset STRICT
export SMALL=2 PLAN=0
tests/gap/blind/gap_check "$scratch/serial" >"$scratch/alone" 2>&1
export OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_btl_vader_single_copy_mechanism=none
MPI_RANKS=2 setsid tests/gap/blind/gap_check "$scratch/ranks" >"$scratch/killed" 2>&1 &
job=$!
for ((i = 0; i < 1200; i++)); do
    [ "$(find "$scratch/ranks/answers" -name '*.json' 2>/dev/null | wc -l)" -ge 1 ] && break
    sleep 0.1
done
kill -TERM -- "-$job"
! wait "$job" && [ ! -e "$scratch/ranks/score.txt" ]
check a_killed_job_has_no_score $?
find "$scratch/ranks/answers" -name '*.json' -newermt '2000-01-01' -printf '%f %T@\n' | LC_ALL=C sort >"$scratch/kept"
MPI_RANKS=2 tests/gap/blind/gap_check "$scratch/ranks" >"$scratch/resumed" 2>&1
cat "$scratch/resumed"
diff "$scratch/serial/score.txt" "$scratch/ranks/score.txt" && diff -r "$scratch/serial/truth" "$scratch/ranks/truth"
check two_ranks_give_the_same_score $?
[ -s "$scratch/kept" ] && find "$scratch/ranks/answers" -name '*.json' -printf '%f %T@\n' | grep -qxF -f "$scratch/kept"
check finished_cases_are_not_diagnosed_again $?
check_end

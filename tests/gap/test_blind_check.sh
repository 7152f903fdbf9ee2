#!/bin/bash
# Half a dozen blind cases through `tribend gap diagnose`: each gets an answer, and no measure is surely missed.
build=${TRIBEND_BUILD:-build}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
passed=0 failed=0
check() { # name, condition's status
    echo "[ RUN      ] $1"
    if [ "$2" -eq 0 ]; then
        echo "[       OK ] $1"
        passed=$((passed + 1))
    else
        echo "[  FAILED  ] $1"
        failed=$((failed + 1))
    fi
}
SMALL=1 STRICT=1 BUILD=$build tests/gap/blind/gap_check "$scratch/work" >"$scratch/said" 2>&1
code=$?
cat "$scratch/said"
! grep -q 'no answer' "$scratch/said"
check every_case_gets_an_answer $?
[ "$code" -eq 0 ]
check no_measure_is_surely_missed $?
echo "[  PASSED  ] $passed test(s)."
[ "$failed" -eq 0 ]

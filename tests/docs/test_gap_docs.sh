#!/bin/bash
# Every command that docs/gap.md shows for another simulator's gap is run as it stands, in order, and must succeed; what it
# promises of the answers is looked up in them.
build=${TRIBEND_BUILD:-build}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
mkdir -p "$build"
passed=0 failed=0

check() { # NAME command...
    local name=$1
    shift
    echo "[ RUN      ] $name"
    if "$@" >"$scratch/out" 2>&1 </dev/null; then
        echo "[       OK ] $name"
        passed=$((passed + 1))
    else
        cat "$scratch/out"
        echo "[  FAILED  ] $name"
        failed=$((failed + 1))
    fi
}

section=$(awk '/^## / { on = /simulator/ } on' docs/gap.md)
while read -r command; do
    check "$command" bash -c "${command//build\//$build/}"
    cp "$scratch/out" "$scratch/last"
done < <(echo "$section" | grep -E '^    (build/|awk )' | sed 's/^ *//')

report=$build/arc-gap.json
check baseline_is_the_simulator grep -q '"baseline": "simulator"' "$report"
check arc_is_no_effect grep -qE '"verdict": "(unknown|recalibrate)"' "$report"
check untried_effects_are_listed grep -q '"name": "valve_dead_time"' "$report"
check page_says_so grep -q 'another simulator' "$build/arc-gap.html"
check table_finds_creep grep -q '^which *creep' "$scratch/last"
echo "[  PASSED  ] $passed test(s)."
[ "$failed" -eq 0 ] && [ "$passed" -eq 9 ]

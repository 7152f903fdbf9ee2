#!/bin/bash
# Where module and model disagree is said by stage and chamber, by `tribend status` and at the end of a run.
build=${TRIBEND_BUILD:-build}
tribend=$build/tribend
passed=0 failed=0
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# says NAME PATTERN command...: the command succeeds, and its line of warnings matches
says() {
    local name=$1 pattern=$2
    shift 2
    echo "[ RUN      ] $name"
    if "$@" >"$scratch/said" 2>&1 && grep -qE "^warnings +$pattern" "$scratch/said"; then
        echo "[       OK ] $name"
        passed=$((passed + 1))
    else
        echo "wanted: warnings $pattern"
        cat "$scratch/said"
        echo "[  FAILED  ] $name"
        failed=$((failed + 1))
    fi
}
says nothing_is_wrong 'none$' "$tribend" status --for 10s
says pressure_sensor_of_a_chamber 'gap between module and model in chamber 2, pressure sensor: ' \
    "$tribend" status --for 10s --effect pressure_offset:offset=1500,chamber=2
says valve_of_a_chamber_after_a_run 'gap between module and model in chamber 3, valve: ' \
    "$tribend" bend 60deg --for 8s -q --effect valve_sluggish:chamber=3,flow_scale=0.4
says tip_sensor_has_no_chamber 'gap between module and model in tip sensor: ' \
    "$tribend" bend 60deg --for 8s -q --effect tip_offset:x=0.004
echo "[  PASSED  ] $passed test(s)."
[ "$failed" -eq 0 ]

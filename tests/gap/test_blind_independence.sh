#!/bin/bash
# The blind data does not come from the simulator that the diagnosis replays, and the diagnosis does not know where the
# truth lies: neither in what is included, nor in what the compiler read, nor in what the linker took.
build=${TRIBEND_BUILD:-build}
blind=tests/gap/blind
passed=0 failed=0
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# check NAME command...: the command succeeds
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
includes_nothing_of_the_simulator() {
    ! grep -nE '^[[:space:]]*#[[:space:]]*include.*(sim/|effect\.h"|host/|link/|log/|gap/)' "$blind"/*.[ch] |
        grep -vE '#include "blind_effect\.h"'
}
# The compiler's own list of every header that a source pulls in.
compiler_reads_nothing_of_the_simulator() {
    local source found=0
    for source in "$blind"/*.c; do
        gcc -std=gnu11 -D_GNU_SOURCE -Ifirmware -Ihal -Ihost -Imodel -Itests -I"$blind" -MM "$source" | tr ' \\' '\n\n' >"$scratch/read" || return 1
        grep -q 'blind_' "$scratch/read" || return 1
        if grep -E '(^|/)(hal/sim|host|model)/' "$scratch/read"; then
            echo "read by $source"
            found=1
        fi
    done
    return "$found"
}
# Symbols of the simulator in the generator, if it is built: its functions start with these words.
links_nothing_of_the_simulator() {
    [ -x "$build/$blind/blind_generate" ] || return 0
    nm "$build/$blind/blind_generate" >"$scratch/symbols" && grep -q ' T blind_plant_step$' "$scratch/symbols" || return 1
    ! grep -E ' [Tt] (sim_(init|advance|bind|add_effect)|effect_register|chambers_step|gas_mass_flow|body_tip_pose|sensor_tip)$' "$scratch/symbols"
}
diagnosis_knows_no_truth() {
    ! grep -rnEi 'gap/blind|blind_|/truth|truth/|truth\.json|sealed' host hal firmware model --include='*.[ch]'
}
catalogue_effects_are_not_shared() {
    local name
    for name in hal/sim/effects/*.c; do
        if cmp -s "$name" "$blind/$(basename "$name")"; then
            return 1
        fi
    done
}
check includes_nothing_of_the_simulator includes_nothing_of_the_simulator
check compiler_reads_nothing_of_the_simulator compiler_reads_nothing_of_the_simulator
check links_nothing_of_the_simulator links_nothing_of_the_simulator
check diagnosis_knows_no_truth diagnosis_knows_no_truth
check catalogue_effects_are_not_shared catalogue_effects_are_not_shared
# A source that did include the simulator must be noticed.
printf '#include "sim/sim_hal.h"\n' >"$scratch/blind_cheat.c"
check a_cheat_would_be_noticed bash -c "gcc -Ifirmware -Ihal -MM '$scratch/blind_cheat.c' | grep -q 'hal/sim/'"
echo "[  PASSED  ] $passed test(s)."
[ "$failed" -eq 0 ]

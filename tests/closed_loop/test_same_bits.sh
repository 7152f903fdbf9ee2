#!/bin/bash
# The controller, built with every compiler at hand and at several optimisations, gives the same bits over a minute of mission.
# A build that lets the compiler fuse multiply and add must differ, or this test could not see a difference.
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
flags="-std=c11 -fno-math-errno -Ifirmware -Ihal"
sources="firmware/control/*.c firmware/safety/*.c tests/closed_loop/same_bits/mission.c"
compilers="gcc"
command -v clang >/dev/null && compilers="gcc clang"
passed=0 failed=0 reference=""
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
run() { # compiler, options: prints the hash
    # shellcheck disable=SC2086
    $1 $flags $2 $sources -lm -o "$scratch/mission" && "$scratch/mission" tables/paper-semicircle.tbt
}
for compiler in $compilers; do
    for level in -O0 -O1 -O2 -O3 -Os "-O3 -march=native"; do
        hash=$(run "$compiler" "$level -ffp-contract=off")
        [ -n "$reference" ] || reference=$hash
        [ -n "$hash" ] && [ "$hash" = "$reference" ]
        check "same_bits_${compiler}_${level// /_}" $?
    done
done
[ "${reference#* }" = ACTIVE ] || [ "${reference#* }" = HOLD ]
check "the_mission_ends_without_a_fault" $?
if grep -q ' fma ' /proc/cpuinfo; then
    [ "$(run gcc "-O3 -march=native -ffp-contract=fast")" != "$reference" ]
    check "a_fused_build_would_be_noticed" $?
fi
echo "reference $reference"
echo "[  PASSED  ] $passed test(s)."
[ "$failed" -eq 0 ] && [ "$passed" -ge 7 ]

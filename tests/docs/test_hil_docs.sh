#!/bin/bash
# The commands of docs/hil.md: its example runs as written, the rest is what tests/hil runs.
. tests/support/check.sh
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
shown=$scratch/said
command=$(sed -n 's/^    \(tests\/hil\/uml\/boot .*\)$/\1/p' docs/hil.md)
[ "${TRIBEND_BUILD:-build}" = build ] || sed "s|build/tribend|$TRIBEND_BUILD/tribend|;s|--bus|--elf $TRIBEND_BUILD/firmware/tribend.elf --bus|" \
    docs/examples/bend_over_can.sh >"$scratch/bend_over_can.sh"
[ ! -e "$scratch/bend_over_can.sh" ] || command=${command/docs\/examples/$scratch}
$command >"$scratch/said" 2>&1
check example_runs $?
[ "$(grep -cE '^ +vcan0 +17[1-9] +\[8\] ' "$scratch/said")" -eq 3 ]
check board_says_its_bend $?
grep -q '051#0101E82800000000' docs/hil.md && grep -qx 'bend_60=E828.*' tests/hil/uml/guest.sh
check frame_is_the_one_that_is_tested $?
grep -q "bend_true_rad" host/board/board_record.c && grep -q '`bend_true_rad`' docs/hil.md
check record_has_the_column $?
check_end

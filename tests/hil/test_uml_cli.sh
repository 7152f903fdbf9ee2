#!/bin/bash
# The whole command line over SocketCAN, against the emulated board inside user-mode Linux. A table of few nodes is sent there:
# the reference table takes half a minute at the board's one frame a control step.
build=${TRIBEND_BUILD:-build}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
"$build/tribend-tables" build paper-semicircle --nodes 4 --mesh-size 1.5mm -q -o "$scratch/small.tbt" >/dev/null || exit 1
tests/hil/uml/boot tests/hil/uml/cli.sh 900 "SMALL_TABLE=$scratch/small.tbt"

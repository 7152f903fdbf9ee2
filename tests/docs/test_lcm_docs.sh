#!/bin/bash
# docs/lcm.md: its channels and types are the bridge's, its options are the program's, its commands are those that tests/hil runs.
. tests/support/check.sh
tribend=${TRIBEND_BUILD:-build}/tribend
wrong=$(sed -n 's/^    X([A-Z_]*, "\([A-Z_]*\)").*/\1/p' host/lcm/bridge.h | grep -v X | while read -r channel; do
    grep -q "^| TRIBEND_$channel | tribend_[a-z]*_t |" docs/lcm.md || echo "$channel"
done)
[ -z "$wrong" ] && [ "$(grep -c '^| TRIBEND_' docs/lcm.md)" -eq 7 ]
check channels_are_listed $?
wrong=$(sed -n 's/^| TRIBEND_[A-Z_]* | \(tribend_[a-z]*_t\) .*/\1/p' docs/lcm.md | while read -r type; do
    [ -e "host/lcm/$type.lcm" ] || echo "$type"
done)
[ -z "$wrong" ]
check types_are_there $?
help=$("$tribend" bridge --help)
wrong=$(grep -o -- '--[a-z][a-z-]*' docs/lcm.md | sort -u | while read -r option; do
    grep -q -- "$option" <<<"$help" || [ "$option" = --lcm ] || echo "$option"
done)
[ -z "$wrong" ] || echo "not options of the bridge: $wrong"
[ -z "$wrong" ]
check options_are_there $?
for words in "lcm-logger -q -c 'TRIBEND_.\*'" "lcm-logplayer -e '^TRIBEND_COMMAND\\$'" 'bridge --bus' '--lcm-log .* --can-log .* --record' 'import --lcm'; do
    grep -q -- "$words" tests/hil/uml/lcm_clients.sh || { echo "not run by tests/hil: $words"; false; }
    check "runs_${words%% *}" $?
done
check_end

#!/bin/bash
# Every subcommand that `tribend` lists: a bad argument, a missing or forbidden device, a forbidden file, a wrong module. Each has its
# message, its remedy and its exit code; a subcommand that is new fails here until it has its row.
build=${TRIBEND_BUILD:-build}
tribend=$build/tribend
scratch=$(mktemp -d)
stub=0
trap 'kill $stub 2>/dev/null; wait 2>/dev/null; chmod -R u+rwx "$scratch"; rm -rf "$scratch"' EXIT
. tests/support/check.sh
shown="$scratch/said"
# the rights of an ordinary user, for root may do everything
plainly=()
[ "$(id -u)" -ne 0 ] || plainly=(setpriv --bounding-set=-dac_override,-dac_read_search)
# gives CODE PATTERN ARGUMENTS: exit code, and what is said on standard error
gives() {
    local code=$1 pattern=$2
    shift 2
    timeout 120 "${plainly[@]}" "$tribend" "$@" >/dev/null 2>"$scratch/said" </dev/null
    local status=$?
    [ "$status" -eq "$code" ] && grep -qE -- "$pattern" "$scratch/said" && return
    echo "exit code $status, wanted $code and /$pattern/: tribend $*" >>"$scratch/said"
    return 1
}
mkdir "$scratch/closed"
: >"$scratch/secret"
printf 'module: paper-semicircle\nsteps:\n  - {for: 1s, pressure: [0mbar, 0mbar, 0mbar]}\n' >"$scratch/plan.yaml"
"$tribend" bend 10deg --for 1s -q --record "$scratch/run.csv" >/dev/null
"$tribend" dbc -o "$scratch/board.dbc" && printf '111#F401F401F4010000\n' >"$scratch/frames" &&
    printf '(1.000000) can0 111#F401F401F4010000\n(1.005000) can0 111#F501F401F4010500\n' >"$scratch/candump"
printf 'module: paper-semicircle\nstiffness_scale: { value: 0.9 }\nsupply_scale: { value: 1 }\neffects: []\n' >"$scratch/soft.yaml"
chmod 000 "$scratch/secret" "$scratch/closed"

# how each is called when all is well; of those that talk to a board, with no bus yet
declare -A called=(
    [bend]="10deg" [pressure]="0kPa 0kPa 0kPa" [run]="$scratch/plan.yaml" [vent]="" [hold]="" [clear]="" [status]="" [monitor]="--json"
    [params]="list" [update]="tables/paper-semicircle.tbt" [record]="-o $scratch/new.csv" [view]="--port 0 --for 1s"
    [bridge]="" [board]="--for 0.1s" [plot]="$scratch/run.csv -o $scratch/new.png" [import]="$scratch/run.csv --candump -o $scratch/new.csv"
    [decode]="$scratch/frames" [dbc]="" [effects]="" ["gap diagnose"]="$scratch/run.csv" ["gap close"]="$scratch/run.csv"
    ["gap plan"]="--group line_volume,line_resistance -o $scratch/new.yaml")
on_bus="bend pressure run vent hold clear status monitor params update record view bridge"
with_module="bend pressure hold clear status monitor params update record view"
# a file that each reads, as it is asked to; and one that it writes
declare -A reads=(
    [run]="$scratch/secret" [update]="$scratch/secret --bus unix:$scratch/bus" [plot]="$scratch/secret -o $scratch/new.png" [decode]="$scratch/secret"
    [import]="$scratch/secret --candump -o $scratch/new.csv" ["gap diagnose"]="-q $scratch/secret" ["gap close"]="$scratch/secret --calibration $scratch/secret" ["gap plan"]="$scratch/secret -o $scratch/new.yaml" [params]="restore $scratch/secret --bus unix:$scratch/bus"
    [bend]="10deg --table $scratch/secret" [pressure]="0kPa 0kPa 0kPa --table $scratch/secret" [status]="--table $scratch/secret"
    [record]="-o $scratch/new.csv --table $scratch/secret" [board]="--elf $scratch/secret --for 0.1s" [view]="--table $scratch/secret"
    [monitor]="--json --table $scratch/secret --for 0.1s")
declare -A writes=(
    [bend]="10deg --for 0.1s --record $scratch/closed/f" [pressure]="0kPa 0kPa 0kPa --for 0.1s --record $scratch/closed/f"
    [run]="$scratch/plan.yaml --record $scratch/closed/f" [plot]="$scratch/run.csv -o $scratch/closed/f" [dbc]="-o $scratch/closed/f"
    [import]="$scratch/candump --candump -o $scratch/closed/f" [record]="-o $scratch/closed/f --for 0.1s"
    [bridge]="--bus unix:$scratch/bus --can-log $scratch/closed/f --for 0.1s" [board]="--for 0.1s --record $scratch/closed/f"
    [params]="backup $scratch/closed/f --bus unix:$scratch/bus" ["gap diagnose"]="-q $scratch/run.csv --json $scratch/closed/f"
    ["gap plan"]="--group line_volume,line_resistance -o $scratch/closed/f" ["gap close"]="$scratch/run.csv --calibration $scratch/soft.yaml --json $scratch/closed/f")

"$build/tests/link/stub/board_stub" "$scratch/bus" >"$scratch/states" 2>&1 &
stub=$!
until_true grep -q SAFE "$scratch/states"
: >"$scratch/none"
: >"$scratch/locked" && chmod 000 "$scratch/locked"
"$build/tests/link/stub/board_stub" "$scratch/locked_bus" >/dev/null 2>&1 &
locked=$!
until_true test -e "$scratch/locked_bus"
chmod 000 "$scratch/locked_bus"

listed() { "$tribend" "$@" 2>&1 | sed -n 's/^  \([a-z]*\)  .*/\1/p'; }
mapfile -t all < <(listed | grep -v '^gap$' && listed gap | sed 's/^/gap /')
[ "${#all[@]}" -ge 22 ]
check the_list_is_there $?
for one in "${all[@]}"; do
    [ -n "${called[$one]+known}" ]
    check "${one/ /_}_has_a_row_here" $?
    # shellcheck disable=SC2086
    "$tribend" $one --help >"$scratch/said" 2>&1 && grep -q 'Example' "$scratch/said"
    check "${one/ /_}_shows_an_example" $?
    # shellcheck disable=SC2086
    gives 2 "unrecognized option '--frobnicate'" $one --frobnicate && grep -qE 'help' "$scratch/said"
    check "${one/ /_}_refuses_an_unknown_option" $?
    # shellcheck disable=SC2086
    [ "$one" = 'gap diagnose' ] || gives 2 'too much|takes no argument|one (file|table|log) at a time|three pressures|it is: |one plan' $one ${called[$one]} surplus surplus
    check "${one/ /_}_refuses_an_argument_too_many" $?
done
for one in $on_bus; do
    # shellcheck disable=SC2086
    gives 7 'no board listens.*tribend board --bus' $one ${called[$one]} --bus "unix:$scratch/missing"
    check "${one/ /_}_names_a_missing_board" $?
    # shellcheck disable=SC2086
    gives 7 'no permission.*[Pp]ermission denied' $one ${called[$one]} --bus "unix:$scratch/locked_bus"
    check "${one/ /_}_names_a_forbidden_board" $?
    # shellcheck disable=SC2086
    gives 7 'no permission .*dialout' $one ${called[$one]} --bus "slcan:$scratch/locked"
    check "${one/ /_}_names_a_forbidden_adapter" $?
    # shellcheck disable=SC2086
    gives 7 "no bus 'can77'.*ip link" $one ${called[$one]} --bus can77
    check "${one/ /_}_names_a_missing_interface" $?
done
for one in $with_module; do
    # shellcheck disable=SC2086
    gives 8 "not 'worm'" $one ${called[$one]} --bus "unix:$scratch/bus" --module worm
    check "${one/ /_}_refuses_another_module" $?
done
for one in "${!reads[@]}"; do
    # shellcheck disable=SC2086
    gives 3 'secret.*[Pp]ermission denied' $one ${reads[$one]}
    check "${one/ /_}_names_a_file_that_it_may_not_read" $?
done
for one in "${!writes[@]}"; do
    # shellcheck disable=SC2086
    gives 5 'closed/f.*[Pp]ermission denied' $one ${writes[$one]}
    check "${one/ /_}_names_a_folder_that_it_may_not_write" $?
done
"$tribend" import "$scratch/candump" --candump -o "$scratch/imported.csv" --json >"$scratch/out" 2>"$scratch/err" &&
    python3 -c 'import json, sys; o = json.load(sys.stdin); assert o["rows"] >= 1 and o["wrote"] == sys.argv[1] and "time_s" in o["columns"]' \
        "$scratch/imported.csv" <"$scratch/out" 2>>"$scratch/err"
check import_as_json $?
# said before the work, which takes several seconds of processor time
long_works=("gap plan --group line_volume,line_resistance -q -o $scratch/closed/f"
    "gap plan --group line_volume,line_resistance -q -o $scratch/new.yaml --json $scratch/closed/f"
    "gap diagnose -q $scratch/long.csv --html $scratch/closed/f" "gap diagnose -q $scratch/long.csv --calibration-out $scratch/closed/f")
"$tribend" bend 60deg --for 20s -q --effect line_volume --record "$scratch/long.csv" >/dev/null
for work in "${long_works[@]}"; do
    # shellcheck disable=SC2086
    (ulimit -t 1 && gives 5 'closed/f.*[Pp]ermission denied' $work)
    check "output_is_tried_first_$(sed 's#[^a-z ]##g; s/  */_/g' <<<"${work%% $scratch*}${work##*$scratch}")" $?
done
[ ! -e "$scratch/new.yaml" ] && [ ! -e "$scratch/new.yaml.part" ]
check nothing_is_left_of_a_work_that_was_not_begun $?
kill "$locked"
check_end

#!/bin/bash
# The subcommands that talk to a board, against the firmware's own node on the simulated HAL, over a Unix socket and over an
# SLCAN terminal: what they do, what they say when something is missing, and how they exit.
build=${TRIBEND_BUILD:-build}
tribend=$build/tribend stub=$build/tests/link/stub/board_stub
scratch=$(mktemp -d)
board=0
trap 'kill $board 2>/dev/null; wait 2>/dev/null; rm -rf "$scratch"' EXIT
. tests/support/check.sh
shown="$scratch/out $scratch/err"
bus=unix:$scratch/bus

# start OPTIONS: a board; its states go to $scratch/states
start() {
    "$stub" "$@" >"$scratch/states" 2>&1 &
    board=$!
    until_true test -e "${*: -1}"
    until_seen SAFE "$scratch/states"
}
stop() {
    kill "$board" 2>/dev/null
    wait "$board" 2>/dev/null
}
# gives CODE PATTERN ARGUMENTS: exit code, and what was printed
gives() {
    local code=$1 pattern=$2
    shift 2
    timeout 120 "$tribend" "$@" >"$scratch/out" 2>"$scratch/err" </dev/null
    local status=$?
    [ "$status" -eq "$code" ] && cat "$scratch/out" "$scratch/err" | grep -qE -- "$pattern"
}
# object EXPRESSION ARGUMENTS: in Python, of the object o, all that is on standard output
object() {
    local expression=$1
    shift
    timeout 120 "$tribend" "$@" >"$scratch/out" 2>"$scratch/err" </dev/null &&
        python3 -c 'import json, sys; o = json.load(open(sys.argv[1])); assert eval(sys.argv[2]), o' "$scratch/out" "$expression" 2>>"$scratch/err"
}
says_no_difference() {
    "$tribend" params diff "$scratch/backup.json" --bus "$bus" >"$scratch/out" 2>"$scratch/err" && [ ! -s "$scratch/out" ]
}
until_seen() { until_true grep -sqE -- "$1" "$2"; } # PATTERN FILE
# recorder_start: into record.csv, what it prints into recorded; until recorder_end, a Ctrl-C
recorder_start() {
    "$tribend" record -o "$scratch/record.csv" --for 60min --bus "$bus" >"$scratch/recorded" 2>&1 &
    recorder=$!
    until_rows 20
}
recorder_end() {
    kill -INT $recorder
    wait $recorder
}
until_rows() { # MORE than there are
    local least
    least=$(($(cat "$scratch/record.csv.part" 2>/dev/null | wc -l) + $1))
    has_rows() { [ "$(cat "$scratch/record.csv.part" 2>/dev/null | wc -l)" -ge $least ]; }
    until_true has_rows
}

# --- nobody there
gives 7 'no board listens.*tribend board' status --bus "unix:$scratch/nothing"
check missing_socket $?
gives 7 "there is no bus 'can77'.*ip link" status --bus can77
check missing_interface $?
gives 7 'plugged in' status --bus "slcan:$scratch/tty"
check missing_adapter $?
gives 7 'bit rates are 10000' status --bus "slcan:$scratch/tty@123"
check bit_rate_that_slcan_has_not $?
gives 7 'no serial device' status --bus slcan:/dev/null
check no_adapter_at_all $?
gives 2 "from 1 to 15" status --bus "$bus" --node 16
check node_out_of_range $?
gives 2 'for the simulation' bend 10deg --bus "$bus" --seed 3
check simulation_option_on_a_bus $?
gives 2 'neither vent nor hold' bend 10deg --on-interrupt sing
check interrupt_unknown $?
for command in vent hold clear status; do
    gives 2 'takes no argument' "$command" now
    check "${command}_with_an_argument" $?
done

# --- a board
start "$scratch/bus"
gives 0 'state +SAFE' status --bus "$bus"
check status_of_a_board $?
gives 0 '"module": "paper-semicircle"' status --json --bus "$bus"
check status_as_json $?
gives 7 'node id 5 answers.*other nodes: 1' status --bus "$bus" --node 5
check other_node_answers $?
gives 8 "not 'worm'" status --bus "$bus" --module worm
check wrong_module $?
gives 9 'nothing to hold.*SAFE' hold --bus "$bus"
check nothing_to_hold $?
gives 0 'nothing to clear' clear --bus "$bus"
check nothing_to_clear $?
gives 0 'bend +39\.|bend +40\.' bend 40deg --toward 30deg --for 5s -q --bus "$bus" --record "$scratch/run.csv"
check bend_over_the_bus $?
gives 0 '"missing"' bend 40deg --for 5s --json --bus "$bus" --record "$scratch/run.csv"
missing=$(sed -n 's/.*"\(missing\|dropped\)": \([0-9]*\).*/\2/p' "$scratch/out" | paste -sd+)
awk -F, -v missing=$((missing)) '/^[0-9]/ { first = rows++ ? first : $1; last = $1 } END { due = 200 * (last - first) + 1
    exit !(rows > 350 && due > 1000 && rows + missing > due - 3 && rows + missing < due + 3) }' "$scratch/run.csv"
check every_report_of_the_bend_is_recorded_or_counted $?
gives 0 'pressures 3\.[0-9]+ kPa|pressures 4\.0' pressure 40mbar 0mbar 0mbar --for 4s -q --bus "$bus"
check pressure_right_after_another_run $?
gives 0 'wrote' record -o "$scratch/record.csv" --for 2s --bus "$bus"
awk -F, '/^[0-9]/ { first = rows++ ? first : $1; last = $1 } END { exit !(rows > 20 && (last - first) / (rows - 1) < 0.006) }' \
    "$scratch/record.csv"
check record_has_200_rows_a_second $?

gives 0 'direction (199|200)\.' bend 20deg --toward 200deg --for 5s -q --bus "$bus"
check direction_beyond_half_a_turn $?

# --- parameters
gives 0 'tip_gain is 0\.15' params set tip_gain 0.15 --bus "$bus"
check parameter_set $?
gives 2 "there is no parameter 'colour'" params get colour --bus "$bus"
check parameter_unknown $?
gives 2 'number from 0 to 1' params set tip_gain 5 --bus "$bus"
check parameter_out_of_bounds $?
gives 2 'it is: set NAME VALUE' params set tip_gain --bus "$bus"
check parameter_without_value $?
gives 2 'bus says where the board is' params list
check parameters_of_the_simulation $?
gives 0 'tip_gain is 0\.15 until' params set tip_gain 0.15 --bus "$bus" && gives 0 'saved' params save --bus "$bus"
check parameters_saved $?
gives 0 'node_id will be 9 from' params set node_id 9 --bus "$bus" && gives 0 'node 1' status --bus "$bus" &&
    gives 0 'node_id will be 1 from' params set node_id 1 --bus "$bus"
check what_holds_from_the_next_start_says_so $?
gives 0 'wrote' params backup "$scratch/backup.json" --bus "$bus"
check parameters_backed_up $?
gives 0 'tip_gain is 0\.3' params set tip_gain 0.3 --bus "$bus"
gives 0 'tip_gain +board 0\.3, file 0\.15' params diff "$scratch/backup.json" --bus "$bus"
check parameters_differ $?
object 'o == {"tip_gain": {"board": 0.3, "file": 0.15}}' params diff "$scratch/backup.json" --json --bus "$bus"
check differences_as_json $?
gives 0 'restored' params restore "$scratch/backup.json" --bus "$bus"
check parameters_restored $?
says_no_difference
check restored_parameters_are_those_backed_up $?
sed 's/"working_pressure_pa": .*,/"working_pressure_pa": 199999,/; s/"tip_gain": .*,/"tip_gain": 0.9,/' "$scratch/backup.json" >"$scratch/conflict.json"
gives 9 'refused it.*in conflict' params restore "$scratch/conflict.json" --bus "$bus"
check conflicting_parameters_are_refused $?
says_no_difference
check and_none_of_them_is_taken $?
sed 's/"tip_gain"/"tip_pain"/' "$scratch/backup.json" >"$scratch/unknown.json"
gives 3 "there is no 'tip_pain'" params restore "$scratch/unknown.json" --bus "$bus"
check unknown_parameter_in_a_file $?
head -c 200 "$scratch/backup.json" >"$scratch/short.json"
gives 3 'short.json:[0-9]+:' params restore "$scratch/short.json" --bus "$bus"
check broken_parameter_file $?

# --- tables
cp tables/paper-semicircle.tbt "$scratch/changed.tbt"
printf U | dd of="$scratch/changed.tbt" bs=1 seek=90000 conv=notrunc status=none
gives 3 'CRC-32 differs' update "$scratch/changed.tbt" --bus "$bus"
check changed_table_is_refused_here $?
head -c 8000 "$scratch/changed.tbt" >"$scratch/short.tbt"
gives 9 'no sound bend table.*keeps what it had' update --unchecked "$scratch/short.tbt" --bus "$bus"
check short_table_is_refused_by_the_board $?
gives 0 'table +on the board, module paper-semicircle' status --bus "$bus"
check and_the_old_one_runs $?
gives 2 'with which table' update --bus "$bus"
check update_without_a_table $?
# of few nodes: the reference table takes half a minute at one frame a control step
"$build/tribend-tables" build paper-semicircle --nodes 4 --mesh-size 1.5mm -q -o "$scratch/small.tbt" >"$scratch/out" 2>"$scratch/err"
gives 0 'runs +table' update "$scratch/small.tbt" -q --bus "$bus"
check table_is_sent_and_runs_after_a_new_start $?
object 'o["restarted"] and o["table"] == o["table_before"] and o["module"] == "paper-semicircle"' update "$scratch/small.tbt" --json --bus "$bus"
check update_as_json $?
gives 0 'tip_gain +0\.15 ' params get tip_gain --bus "$bus"
check saved_parameters_outlast_the_new_start $?
gives 0 '"state":"SAFE"' monitor --json --for 1s --bus "$bus"
check monitor_as_json $?
stop
start "$scratch/bus"

# --- Ctrl-C vents, or holds and then vents
"$tribend" bend 30deg --for 60min -q --bus "$bus" >"$scratch/out" 2>"$scratch/err" &
host=$!
until_seen ACTIVE "$scratch/states"
kill -INT $host
wait $host
[ $? -eq 130 ] && grep -q 'interrupted.*venting' "$scratch/out" && grep -q 'vented' "$scratch/out"
check interrupt_vents_and_says_so $?
: >"$scratch/states"
"$tribend" bend 30deg --for 60min -q --on-interrupt hold --bus "$bus" >"$scratch/out" 2>"$scratch/err" &
host=$!
until_seen ACTIVE "$scratch/states"
kill -INT $host
until_seen HOLD "$scratch/states"
check interrupt_holds_when_asked_to $?
kill -INT $host
wait $host
[ $? -eq 130 ] && tail -1 "$scratch/states" | grep -q SAFE
check second_interrupt_vents $?

# --- another host holds what the first one began
: >"$scratch/states"
"$tribend" bend 30deg --for 60min -q --bus "$bus" >"$scratch/first" 2>&1 &
host=$!
until_seen ACTIVE "$scratch/states"
gives 9 'another host commands it' bend 10deg --bus "$bus"
check second_host_is_refused $?
tail -1 "$scratch/states" | grep -q ACTIVE
check second_host_does_not_vent_the_first $?
gives 0 'vented' vent --bus "$bus"
check vent_over_another_host $?
wait $host
[ $? -eq 9 ] && grep -q 'another host vented it' "$scratch/first"
check first_host_says_that_it_was_vented $?

# --- a motion is taken over and held, until the one who holds it vents
: >"$scratch/states"
"$tribend" bend 30deg --for 60min -q --bus "$bus" >"$scratch/first" 2>&1 &
host=$!
until_seen ACTIVE "$scratch/states"
gives 0 'holding +[0-9.-]+ [0-9.-]+ [0-9.-]+ kPa' hold --for 1s --bus "$bus" && tail -1 "$scratch/out" | grep -q '^venting  *state SAFE'
check hold_takes_over_and_vents_at_its_end $?
grep -q 'holding' "$scratch/out" && grep -q 'HOLD' "$scratch/states" && tail -1 "$scratch/states" | grep -q SAFE
check what_is_held_is_held_on_the_board $?
wait $host
[ $? -eq 9 ] && grep -q 'another host' "$scratch/first"
check host_whose_motion_was_taken_over_says_so $?

# --- the host is killed: the module vents by itself, and says why
: >"$scratch/states"
"$tribend" bend 30deg --for 60min -q --bus "$bus" >"$scratch/out" 2>&1 &
host=$!
until_seen ACTIVE "$scratch/states"
kill -KILL $host
wait $host 2>/dev/null
until_seen FAULT "$scratch/states"
check killed_host_leaves_a_vented_module $?
gives 6 'faults +command timeout' status --bus "$bus"
check status_says_command_timeout $?
gives 6 'command timeout' bend 10deg --bus "$bus"
check fault_refuses_a_bend $?
gives 0 'cleared +command timeout' clear --bus "$bus"
check fault_is_cleared_on_purpose $?

# --- the cable is pulled and put back
: >"$scratch/states"
recorder_start
"$tribend" bend 30deg --for 60min -q --bus "$bus" >"$scratch/out" 2>"$scratch/err" &
host=$!
until_seen ACTIVE "$scratch/states"
kill -USR1 "$board"
wait $host
[ $? -eq 7 ] && grep -q 'went away' "$scratch/err"
check pulled_cable_ends_a_bend $?
tail -1 "$scratch/states" | grep -q 'FAULT'
check pulled_cable_vents_the_module $?
kill -USR1 "$board"
until_seen FAULT "$scratch/record.csv.part"
recorder_end
[ $? -eq 130 ] && grep -q 'fell silent [1-9][0-9]* times' "$scratch/recorded" && tail -1 "$scratch/record.csv" | grep -q FAULT
check recorder_comes_back_by_itself_and_counts $?
gives 6 'faults +command timeout' record -o "$scratch/record.csv" --for 0.5s --bus "$bus"
check recorded_fault_has_its_exit_code $?
gives 0 'cleared' clear --bus "$bus"
check clear_after_the_cable $?

# --- the board goes and comes
recorder_start
stop
sleep 0.7 # half a second is silence
start "$scratch/bus"
until_rows 200
recorder_end
[ $? -eq 130 ] && grep -q 'silent [1-9][0-9]* times, started anew 1 times' "$scratch/recorded"
check recorder_outlives_a_board $?
awk -F, '/^[0-9]/ { if ($1 <= last) bad = 1; last = $1; rows++ } END { exit bad || rows < 200 }' "$scratch/record.csv"
check its_time_goes_on $?
stop

# --- two boards on one bus
start -n 2 -n 7 "$scratch/bus"
until_seen 'node 7 SAFE' "$scratch/states"
: >"$scratch/states"
gives 0 'bend +(19|20)\.' bend 20deg --for 5s -q --node 7 --bus "$bus"
check bend_of_node_7 $?
grep -q 'node 7 ACTIVE' "$scratch/states" && ! grep -q 'node 2' "$scratch/states"
check node_2_does_not_move $?
gives 0 'board +node 2' status --node 2 --bus "$bus"
check status_of_node_2 $?
stop

# --- a board that answers late: the time of a hold is that of the holding
start -d 200 "$scratch/bus"
: >"$scratch/states"
"$tribend" bend 30deg --for 60min -q --bus "$bus" >"$scratch/first" 2>&1 &
host=$!
until_seen ACTIVE "$scratch/states"
gives 0 'holding +[0-9.-]+ [0-9.-]+ [0-9.-]+ kPa' hold --for 50ms --bus "$bus" && grep -q 'HOLD' "$scratch/states"
check hold_counts_from_the_holding $?
wait $host
stop

# --- another version
start -p 3 "$scratch/bus"
gives 8 'version 3 .*this program version 1.*newer tribend' bend 20deg --bus "$bus"
check other_version_is_said_at_connect $?
gives 0 'vented' vent --bus "$bus"
check vent_works_between_versions $?
stop

# --- SLCAN
start -l "$scratch/tty"
gives 0 'bend +(19|20)\.' bend 20deg --for 5s -q --bus "slcan:$scratch/tty"
check bend_over_slcan $?
gives 0 'state +SAFE' status --bus "slcan:$scratch/tty@500000"
check slcan_again_after_closing $?
stop
check_end

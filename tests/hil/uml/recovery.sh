# Inside user-mode Linux: board, bridge and command line lose each other in every way, and find each other again by themselves; the
# module vents on the command timeout meanwhile; all of it is counted. The board's own words are the oracle.
# ALL_ORDERS=1: all six orders of killing and starting the three, in place of three.
. tests/hil/uml/guest.sh
shown="$SCRATCH/bend.out $SCRATCH/clear.out"
mission=$TRIBEND_BUILD/tests/hil/uml/mission
touch "$SCRATCH/bend.out" "$SCRATCH/clear.out"
boards=0 bridges=0 monitors=0
# state BOARD-NAME: what its firmware last said
board_state() { sed -n 's/.*state: //p' "$SCRATCH/board_$boards.out" 2>/dev/null | tail -n 1; }
board_says() { [ "$(board_state)" = "$1" ]; }
times_said() { grep -cs "$2" "$SCRATCH/$1.out"; } # NAME PATTERN
said_times() { [ "$(times_said "$1" "$2")" -ge "$3" ]; }
# number NAME: the newest of that name that the monitor told
told() { tail -n 1 "$SCRATCH/monitor_$monitors.out" 2>/dev/null | tr ',{}' '\n' | sed -n "s/\"$1\"://p" | head -n 1; }
told_least() { awk -v v="$(told "$1")" -v least="$2" 'BEGIN { exit !(v != "" && v >= least) }'; }
told_under() { awk -v v="$(told "$1")" -v most="$2" 'BEGIN { exit !(v != "" && v < most) }'; }
bridge_counts() { # NAME LEAST, over LCM
    "$mission" listen 1.2 >"$SCRATCH/heard"
    awk -v name="$1" -v least="$2" '$1 == name { v = $2 } END { exit !(v >= least) }' "$SCRATCH/heard"
}

start_board() {
    boards=$((boards + 1))
    board_start "board_$boards"
}
start_bridge() {
    bridges=$((bridges + 1))
    "$tribend" bridge --bus vcan0 >"$SCRATCH/bridge_$bridges.out" 2>&1 &
    bridge=$!
}
# it ends where there is no board: whoever wants it to wait starts it again
start_cli() {
    monitors=$((monitors + 1))
    (
        until "$tribend" monitor --json --bus vcan0 >"$SCRATCH/monitor_$monitors.out" 2>"$SCRATCH/monitor_$monitors.err" &
            echo $! >"$SCRATCH/monitor_pid" && wait $!; do
            [ ! -e "$SCRATCH/monitor_stop" ] || break
        done
    ) 2>/dev/null &
    watching=$!
}
kill_board() { board_end KILL; }
kill_bridge() {
    kill -KILL "$bridge"
    wait "$bridge" 2>/dev/null
}
kill_cli() {
    touch "$SCRATCH/monitor_stop"
    kill -KILL "$(cat "$SCRATCH/monitor_pid")" 2>/dev/null
    wait "$watching" 2>/dev/null
    rm -f "$SCRATCH/monitor_stop"
}
all_hear() {
    until_true board_says SAFE && until_true said_times "bridge_$bridges" 'board *is heard' "${1:-1}" && until_true told_under silence_s 0.5
}
moves() {
    "$mission" steady 1000 >"$SCRATCH/flying" &
    flying=$!
    until_true board_says ACTIVE
}
still() {
    kill -KILL "$flying" 2>/dev/null
    wait "$flying" 2>/dev/null
}
cleared() { timeout 120 "$tribend" clear --bus vcan0 >"$SCRATCH/clear.out" 2>&1 && until_true board_says SAFE; }
timed_out() { board_says 'FAULT: command timeout'; }

start_bridge
start_cli
start_board
all_hear
check all_three_meet $?

# the cable is pulled while the module bends
moves
check module_bends_over_the_bridge $?
ip link set vcan0 down
until_true timed_out
check pulled_cable_vents $?
until_true told_least silence_s 1
check command_line_sees_the_silence $?
until_true said_times "bridge_$bridges" 'vcan0 is gone: Network is down' 1
check bridge_says_that_the_bus_is_gone $?
ip link set vcan0 up
until_true said_times "bridge_$bridges" 'vcan0 is back' 1 && until_true told_under silence_s 0.5
check all_are_back_by_themselves $?
until_true told_least reconnects 1 && until_true told_least silences 1
check command_line_counts_it $?
until_true bridge_counts reopened 1 && until_true bridge_counts flying 5
check bridge_counts_it_and_refuses_what_flies $?
timed_out
check module_stays_vented $?
still
cleared
check fault_is_cleared_over_the_bus_that_came_back $?

# the command line is killed while it watches: nothing happens to the motion
moves
check module_bends_again $?
kill_cli
start_cli
until_true told_under silence_s 0.5 && board_says ACTIVE
check killed_watcher_stops_nothing $?

# the bridge is killed while the module bends over it
kill_bridge
until_true timed_out
check killed_bridge_vents $?
start_bridge
until_true said_times "bridge_$bridges" 'board *is heard' 1 && until_true bridge_counts flying 5 && timed_out
check bridge_is_back_and_refuses_what_flies $?
still
cleared
check fault_is_cleared_again $?

# the board is killed while it bends: a power cut, and its module is vented with it
moves
check module_bends_after_the_bridge_came_back $?
kill_board
until_true said_times "bridge_$bridges" 'board *fell silent' 1 && until_true told_least silence_s 1
check silence_of_the_board_is_noticed $?
start_board
until_true board_says SAFE && until_true said_times "bridge_$bridges" 'board *is heard' 2 && until_true told_under silence_s 0.5
check board_is_heard_again $?
until_true told_least restarts 1 && until_true told_least silences 1 && until_true bridge_counts restarts 1 && until_true bridge_counts silences 1
check start_anew_is_counted $?
board_says SAFE
check what_flies_does_not_move_it $?
still

# the command line is killed while it bends the module itself
"$tribend" bend 40deg --for 1000s -q --bus vcan0 >"$SCRATCH/bend.out" 2>&1 &
bending=$!
until_true board_says ACTIVE
check command_line_bends_the_module $?
kill -KILL $bending
wait $bending 2>/dev/null
until_true timed_out
check killed_host_vents $?
cleared && timeout 120 "$tribend" bend 20deg --for 1s -q --bus vcan0 >"$SCRATCH/bend.out" 2>&1
check another_one_clears_it_and_bends $?

# killed and started in every order
orders=('board bridge cli' 'bridge cli board' 'cli board bridge')
[ -z "${ALL_ORDERS:-}" ] || orders+=('board cli bridge' 'bridge board cli' 'cli bridge board')
for order in "${orders[@]}"; do
    for one in $order; do
        "kill_$one"
    done
    for one in $order; do
        "start_$one"
    done
    all_hear
    check "killed_and_started_${order// /_}" $?
done
moves
check module_bends_after_all_of_it $?
still
kill_cli
kill "$bridge"
wait "$bridge"
grep -q 'frames_overflowed *0 ' "$SCRATCH/bridge_$bridges.out" && grep -q 'unpublished *0 ' "$SCRATCH/bridge_$bridges.out"
check nothing_was_dropped $?
board_end TERM
check_end

# Inside user-mode Linux: every subcommand that talks to a board, over SocketCAN, against the emulated board on vcan0: classic and FD,
# error frames, the kernel's time stamps; real cansend and candump beside them.
. tests/hil/uml/guest.sh
shown="$SCRATCH/said.out $SCRATCH/said.err"
# gives CODE PATTERN ARGUMENTS: tribend's exit code, and what it printed
gives() {
    local code=$1 pattern=$2
    shift 2
    timeout 120 "$tribend" "$@" >"$SCRATCH/said.out" 2>"$SCRATCH/said.err" </dev/null
    local status=$?
    [ "$status" -eq "$code" ] || echo "exit code $status, not $code: $*" >>"$SCRATCH/said.err"
    [ "$status" -eq "$code" ] && cat "$SCRATCH/said.out" "$SCRATCH/said.err" | grep -qE -- "$pattern"
}
# rows a second, from the first to the last; a lost one shows, for no row says what another did
row_rate() { awk -F, '$1 ~ /^[0-9]/ { first = n++ ? first : $1; last = $1 } END { if (n > 1) print (n - 1) / (last - first); else print "none" }' "$1"; }
told_fd() { [ "$(grep -cE ' 7?[0-9A-F]+##' "$dump")" -gt 20 ]; }
ended() { ! kill -0 "$1" 2>/dev/null; }

gives 7 "no bus 'can7'.*ip link" status --bus can7
check missing_interface $?
gives 7 'no CAN interface' status --bus lo
check interface_of_another_kind $?
gives 7 'no board with node id 1 answers .0 frames' status --bus vcan0
check nobody_on_the_bus $?
candump_start cli
board_start first
board_ready
gives 0 'state +SAFE' status --bus vcan0
check status $?
gives 0 '"state": "SAFE"' status --json --bus vcan0
check status_as_json $?
gives 7 'node id 4 answers.*other nodes: 1' status --bus vcan0 --node 4
check another_node_is_there $?
gives 8 "not 'worm'" status --bus vcan0 --module worm
check another_module_is_there $?
gives 9 'nothing to hold' hold --bus vcan0
check nothing_to_hold $?

gives 0 'bend +(39|40)\.' bend 40deg --toward 30deg --for 5s -q --bus vcan0 --record "$SCRATCH/run.csv"
check bend $?
near "$(row_rate "$SCRATCH/run.csv")" 200 2
check its_log_has_200_rows_a_second $?
gives 0 'pressures +3\.9|pressures +4\.' pressure 40mbar 0mbar 0mbar --for 4s -q --bus vcan0
check pressure $?
cat >"$SCRATCH/plan.yaml" <<'YAML'
module: paper-semicircle
steps:
  - {for: 0.5s, pressure: [40mbar, 0mbar, 0mbar]}
  - {for: 0.5s, pressure: [0mbar, 0mbar, 0mbar]}
YAML
gives 0 'pressures|vented|state' run "$SCRATCH/plan.yaml" -q --bus vcan0
check plan $?
gives 0 'vented' vent --bus vcan0
check vent $?
gives 0 '"state":"SAFE"' monitor --json --for 0.5s --bus vcan0
check monitor_as_json $?
gives 0 'wrote' record -o "$SCRATCH/idle.csv" --for 0.5s --bus vcan0
check record $?

# a motion that cansend began is held, by a host that takes over; a slow one is hard to stay ahead of
BEND_PAUSE=0.2 bend_start $bend_60
until_true told_state 3
"$tribend" hold --bus vcan0 --for 2s >"$SCRATCH/said.out" 2>"$SCRATCH/said.err" &
holding=$!
wait $holding
[ $? -eq 0 ] && grep -q 'holding' "$SCRATCH/said.out" && grep -q 'venting' "$SCRATCH/said.out"
check hold_takes_over_from_cansend_and_vents_at_its_end $?
bend_stop
has_held() { field_values "10$node" 0 1 | awk '$1 % 16 == 4 { held = 1 } END { exit !held }'; }
until_true has_held
check board_was_in_hold $?

# a fault that stays until it is cleared
bend_start $bend_60
until_true told_state 3
bend_stop
until_true told_state 5
gives 6 'faults +command timeout' status --bus vcan0
check status_says_the_fault $?
gives 6 'command timeout' bend 10deg --bus vcan0
check fault_refuses_a_bend $?
gives 0 'cleared +command timeout' clear --bus vcan0
check fault_is_cleared $?

# parameters, through a power cut; then telemetry by CAN FD
gives 0 'tip_gain' params list --bus vcan0
check parameters $?
gives 0 'wrote' params backup "$SCRATCH/backup.json" --bus vcan0
check parameters_backed_up $?
gives 0 'tip_gain is 0\.21' params set tip_gain 0.21 --bus vcan0
check parameter_set $?
gives 0 'can_fd will be 1 from' params set can_fd 1 --bus vcan0 && gives 0 'saved' params save --bus vcan0
check parameters_saved $?
cansend vcan0 "46$node#00017A5E" # RESET
until_true told_fd
check telemetry_comes_by_can_fd_after_the_next_start $?
gives 0 'tip_gain.*0\.21' params get tip_gain --bus vcan0
check saved_parameters_outlast_the_start $?
gives 0 'bend +(39|40)\.' bend 40deg --for 5s -q --bus vcan0 --record "$SCRATCH/fd.csv"
check bend_with_can_fd $?
near "$(row_rate "$SCRATCH/fd.csv")" 200 2
check its_log_has_200_rows_a_second_too $?
gives 0 'restored' params restore "$SCRATCH/backup.json" --bus vcan0
check parameters_restored $?

# error frames, as a controller's driver makes them: bus-off, then restarted
"$tribend" monitor --json --bus vcan0 >"$SCRATCH/monitor.out" 2>&1 &
listening=$!
until_true test -s "$SCRATCH/monitor.out"
cansend vcan0 20000040#0000000000000000
cansend vcan0 20000100#0000000000000000
until_true grep -q '"error_frames":2,"bus_off":1,' "$SCRATCH/monitor.out"
check error_frames_and_bus_off_are_counted $?
kill -INT $listening
wait $listening

# time stamps: the kernel's, so the same to the microsecond as candump's
"$tribend" bridge --bus vcan0 --quiet --can-log "$SCRATCH/bridge.can" --for 1.2s >"$SCRATCH/bridge.out" 2>&1
mark
grep -F " 10$node#" "$SCRATCH/bridge.can" | head -n 100 >"$SCRATCH/stamped"
[ "$(wc -l <"$SCRATCH/stamped")" -ge 5 ] && [ -z "$(grep -vxFf "$dump" "$SCRATCH/stamped")" ]
check time_stamps_are_the_kernels $?
gives 0 'STATUS from node 1' decode -l "$dump"
check candump_log_is_decoded $?
gives 0 'rows' import --candump "$dump" -o "$SCRATCH/imported.csv"
check candump_log_is_imported $?
gives 0 'runs +table' update "$SMALL_TABLE" -q --bus vcan0
check table_sent_and_board_started_anew $?
board_end TERM
gives 7 'no board with node id 1 answers' bend 10deg --bus vcan0
check board_is_gone $?
kill "$candump"
check_end

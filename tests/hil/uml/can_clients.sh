# Inside user-mode Linux: the emulated board on vcan0, commanded with real cansend, heard with real candump.
. tests/hil/uml/guest.sh
BOARD_NICE=19 # a process for each command
safe=2 active=3 fault=5 timeout_fault=4
plant() { # NAME AWK-PROGRAM over the board's own record, columns by name in c[]
    awk -F, '/^#/ { next } !n { for (i = 1; i <= NF; i++) c[$i] = i; n = 1; next } '"$2" "$SCRATCH/$1.csv"
}

candump_start can
board_start first
board_ready
check board_is_heard_by_candump $?

bend_start $bend_60
until_true holds_bend 60 2
check cansend_bends_the_module $?
told_state $active
check status_says_active $?

bend_stop
until_true told_state $fault
check silence_is_a_fault $?
[ "$(faults)" -eq "$timeout_fault" ]
check it_is_the_command_timeout $?
sed "/ 10$node#.5/q" "$dump" >"$SCRATCH/until_fault.log" # FAULT in the lower half of the first byte
told_deg=$(dump=$SCRATCH/until_fault.log bend_deg 60) # 0.3 s of the board's, as the plant's below
near "$told_deg" 60 1
check candump_hears_the_bend_that_was_asked_for $?
vented() { [ "$(highest_pressure_pa)" -lt 1000 ]; }
until_true vented
check silence_vents_the_module $?
until_true more_frames "17$node" $(($(frames "17$node") + 200)) # another second of the board's
board_end TERM
plant_deg=$(plant first '{ if ($c["valve1"] + $c["valve2"] + $c["valve3"] > 0) last = NR; bend[NR] = $c["bend_true_rad"] }
    END { for (r = last - 300; r < last; r++) s += bend[r]; printf "%.3f", s / 300 * 57.29578 }')
near "$plant_deg" 60 1
check plant_was_bent_as_asked $?
near "$plant_deg" "$told_deg" 0.5
check plant_and_telemetry_agree $?
plant first 'END { exit !($c["p1_true_pa"] < 500 && $c["p2_true_pa"] < 500 && $c["p3_true_pa"] < 500 && $c["bend_true_rad"] < 0.02) }'
check plant_is_vented_at_the_end $?
echo "bend told $told_deg deg, plant's $plant_deg deg"

# a board that is killed while it bends, and comes back while commands are still flying
board_start second
board_ready
bend_start $bend_60
until_true told_bend 60 1.5
check another_board_bends $?
board_end KILL
mark
until_true more_frames "05$node" $(($(frames "05$node") + 3))
silent=$(after_mark | grep -cvF " 05$node#")
[ "$silent" -eq 0 ]
check killed_board_is_silent $?
bend_stop
board_start third
board_ready
check restarted_board_is_heard $?
bend_start $bend_60
until_true told_bend 60 1.5
check restarted_board_bends $?
bend_stop
board_end TERM
kill "$candump"
check_end

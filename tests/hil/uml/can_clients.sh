# Inside user-mode Linux: the emulated board on vcan0, commanded with real cansend, heard with real candump.
. tests/hil/uml/guest.sh
safe=2 active=3 fault=5 timeout_fault=4
plant() { # NAME AWK-PROGRAM over the board's own record, columns by name in c[]
    awk -F, '/^#/ { next } !n { for (i = 1; i <= NF; i++) c[$i] = i; n = 1; next } '"$2" "$SCRATCH/$1.csv"
}

candump_start can
board_start first
within 20 told_state $safe
check board_is_heard_by_candump $?

bend_start $bend_60
within 30 told_bend 60 1.5
check cansend_bends_the_module $?
told_state $active
check status_says_active $?
more_bends() { [ "$(frames "17$node")" -ge "$1" ]; }
within 30 more_bends $(($(frames "17$node") + 200)) # told_bend may have seen it on its way: settled first, then the mean
settled_deg=$(bend_deg 100)
near "$settled_deg" 60 1
check candump_hears_the_bend_that_was_asked_for $?

bend_stop
within 20 told_state $fault
check silence_is_a_fault $?
[ "$(faults)" -eq "$timeout_fault" ]
check it_is_the_command_timeout $?
vented() { [ "$(highest_pressure_pa)" -lt 1000 ]; }
within 20 vented
check silence_vents_the_module $?
board_end TERM
plant_deg=$(plant first '{ if ($c["valve1"] + $c["valve2"] + $c["valve3"] > 0) last = NR; bend[NR] = $c["bend_true_rad"] }
    END { for (r = last - 300; r < last; r++) s += bend[r]; printf "%.3f", s / 300 * 57.29578 }')
near "$plant_deg" 60 1
check plant_was_bent_as_asked $?
near "$plant_deg" "$settled_deg" 0.5
check plant_and_telemetry_agree $?
plant first 'END { exit !($c["p1_true_pa"] < 500 && $c["p2_true_pa"] < 500 && $c["p3_true_pa"] < 500 && $c["bend_true_rad"] < 0.02) }'
check plant_is_vented_at_the_end $?
echo "bend told $settled_deg deg, plant's $plant_deg deg"

# a board that is killed while it bends, and comes back while commands are still flying
board_start second
heard() { [ "$(frames "10$node")" -gt "$1" ]; }
within 20 heard "$(frames "10$node")"
within 20 told_state $safe
bend_start $bend_60
within 30 told_bend 60 1.5
check another_board_bends $?
board_end KILL
before=$(wc -l <"$dump")
sent() { [ "$(frames "05$node")" -gt "$1" ]; }
within 20 sent $(($(frames "05$node") + 3))
silent=$(tail -n +$((before + 1)) "$dump" | grep -cvF " 05$node#")
[ "$silent" -le 2 ] # what candump had not yet written
check killed_board_is_silent $?
count=$(frames "10$node")
bend_stop
board_start third
within 20 heard $((count + 20))
check restarted_board_is_heard $?
within 20 told_state $safe
bend_start $bend_60
within 30 told_bend 60 1.5
check restarted_board_bends $?
bend_stop
board_end TERM
kill "$candump"
check_end

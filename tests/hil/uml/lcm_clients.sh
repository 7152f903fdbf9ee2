# Inside user-mode Linux, all together: the emulated board on vcan0, the bridge, lcm-logger, lcm-logplayer, candump, cansend
# and canplayer. A mission flown over LCM and replayed from its log bends the module alike; so say board, candump and log.
. tests/hil/uml/guest.sh
mission=$TRIBEND_BUILD/tests/hil/uml/mission
shown="$SCRATCH/bridge_1.out $SCRATCH/bridge_2.out"
touch "$SCRATCH/bridge_1.out" "$SCRATCH/bridge_2.out"
safe=2
plant() { # NAME AWK-PROGRAM over the board's own record, columns by name in c[]
    awk -F, '/^#/ { next } !n { for (i = 1; i <= NF; i++) c[$i] = i; n = 1; next } '"$2" "$SCRATCH/$1.csv"
}
# the plant's highest bend, held for 0.2 s of board time, and its bend over the last 0.2 s before the valves shut, degrees
plant_bends() {
    plant "$1" '{ bend[++r] = $c["bend_true_rad"]; if ($c["valve1"] + $c["valve2"] + $c["valve3"] > 0) last = r }
        END { for (i = 1; i <= r; i++) { s += bend[i]; if (i > 200) s -= bend[i - 200]; if (i >= 200 && s > most) most = s }
              for (i = last - 199; i <= last; i++) end += bend[i]
              printf "%.3f %.3f\n", most / 200 * 57.29578, end / 200 * 57.29578 }'
}
bridge_start() { # NAME options..
    local name=$1
    shift
    "$tribend" bridge --bus vcan0 "$@" >"$SCRATCH/$name.out" 2>&1 &
    bridge=$!
}
bridge_end() { # SIGNAL
    kill "-$1" "$bridge" 2>/dev/null
    wait "$bridge" 2>/dev/null
}
said() { grep -qs "$2" "$SCRATCH/$1.out"; } # NAME PATTERN
counter() { awk -v name="$2" '$1 == name { print $2 }' "$SCRATCH/$1.out"; } # NAME COUNTER

candump_start both
board_start first
bridge_start bridge_1 --lcm-log "$SCRATCH/bridge.lcm" --can-log "$SCRATCH/bridge.can" --record "$SCRATCH/run.csv"
until_true said bridge_1 'board *is heard'
check bridge_hears_the_board $?
"$mission" get 1 >"$SCRATCH/parameter" && grep -q 'value 1 status 0' "$SCRATCH/parameter"
check parameter_over_lcm $?
board_ready
check board_is_ready $?
lcm-logger -q -c 'TRIBEND_.*' "$SCRATCH/mission.lcm" >"$SCRATCH/logger.out" 2>&1 &
logger=$!
until_true test -s "$SCRATCH/mission.lcm" # it hears the bridge
"$mission" arm 60
check mission_is_flown $?
until_true told_state $safe
kill "$logger"
wait "$logger" 2>/dev/null
bridge_end TERM
board_end TERM
[ "$(counter bridge_1 commands_flying)" -eq 0 ] && [ "$(counter bridge_1 commands_forwarded)" -gt 5 ]
check commands_were_carried $?
[ "$(counter bridge_1 frames_overflowed)" -eq 0 ] && [ "$(counter bridge_1 unpublished)" -eq 0 ]
check nothing_was_dropped $?

# the same again, from lcm-logger's log; its commands are old, and there is no arm but the one in the log
board_start second
bridge_start bridge_2
until_true said bridge_2 'board *is heard'
board_ready
lcm-logplayer -e '^TRIBEND_COMMAND$' "$SCRATCH/mission.lcm" >"$SCRATCH/player.out" 2>&1
check mission_is_replayed $?
until_true told_state $safe
bridge_end TERM
board_end TERM
plant_bends first >"$SCRATCH/bends"
read -r most end <"$SCRATCH/bends"
plant_bends second >"$SCRATCH/bends"
read -r most_again end_again <"$SCRATCH/bends"
echo "flown $most then $end deg, replayed $most_again then $end_again deg"
near "$most" 60 1 && near "$end" 35 1
check mission_bends_as_commanded $?
# closed loop: 0.19 deg rms at most, each of the two; 0.5 deg is nearly twice that of their difference
near "$most_again" "$most" 0.5 && near "$end_again" "$end" 0.5
check replay_bends_the_same $?

# the logs: lcm-logger's and ours become run logs, and the tip in them bent as far
tip_bend() { awk -F, '/^#/ { next } !n { for (i = 1; i <= NF; i++) c[$i] = i; n = 1; next }
    $c["tip_qx"] != "" { s = $c["tip_qx"] ^ 2 + $c["tip_qy"] ^ 2; b = 2 * atan2(sqrt(s), sqrt(1 - s)) * 57.29578; if (b > most) most = b }
    END { print most + 0 }' "$1"; }
for log in mission bridge; do
    "$tribend" import --lcm "$SCRATCH/$log.lcm" -o "$SCRATCH/$log.csv" >"$SCRATCH/import.out" 2>&1
    check "${log}_log_is_imported" $?
    near "$(tip_bend "$SCRATCH/$log.csv")" "$most" 3
    check "${log}_log_has_the_bend" $?
done
near "$(tip_bend "$SCRATCH/run.csv")" "$most" 3
check run_log_has_the_bend $?

# ours, played by the others: canplayer puts every frame on the bus again, here the first 300
head -n 300 "$SCRATCH/bridge.can" >"$SCRATCH/start.can"
mark
from=$marker
canplayer -I "$SCRATCH/start.can" -t vcan0=vcan0 >"$SCRATCH/player.out" 2>&1
mark
diff <(cut -d' ' -f3 "$SCRATCH/start.can") <(after_mark "$from" | cut -d' ' -f3) >"$SCRATCH/player.diff" && [ "$(wc -l <"$SCRATCH/start.can")" -eq 300 ]
check canplayer_plays_our_log $?
lcm-logplayer -s 20 "$SCRATCH/bridge.lcm" >"$SCRATCH/player.out" 2>&1
check logplayer_plays_our_log $?

# a command that is already flying when the bridge starts
board_start third
board_ready
"$mission" fly 1000 >"$SCRATCH/flying" &
flying=$!
until_true test -s "$SCRATCH/flying"
bridge_start bridge_3 --lcm-log "$SCRATCH/killed.lcm" --can-log "$SCRATCH/killed.can" --record "$SCRATCH/killed.csv"
until_true said bridge_3 'board *is heard'
bridge_tells() { # its gate and its counters
    "$mission" listen 1.2 >"$SCRATCH/heard"
    read -r open refused forwarded < <(awk '{ v[$1] = $2 } END { print v["open"] + 0, v["flying"] + 0, v["forwarded"] + 0 }' "$SCRATCH/heard")
}
has_refused() { bridge_tells && [ "$refused" -gt "$1" ]; }
until_true has_refused 5
[ "$open" -eq 0 ] && [ "$refused" -gt 5 ] && [ "$forwarded" -eq 0 ] && told_state $safe
check flying_command_is_refused $?
echo "flying: gate open $open, refused $refused, forwarded $forwarded"
kill -9 "$flying"
wait "$flying" 2>/dev/null
refuses_no_more() {
    local before=$refused
    bridge_tells && [ "$refused" -eq "$before" ]
}
until_true refuses_no_more
until_true refuses_no_more # the second that a pause takes, for sure
"$mission" fly 1000 >"$SCRATCH/flying" &
flying=$!
until_true told_bend 60 1.5
check after_a_pause_it_passes $?

# a killed recorder
date +%s.%N >"$SCRATCH/killed_at"
bridge_end KILL
until_true told_state 5
check silence_of_a_killed_bridge_vents $?
kill -9 "$flying"
wait "$flying" 2>/dev/null
mark
# what was on the bus last before that, and a second before it
least=$(awk -v at="$(cat "$SCRATCH/killed_at")" '{ t = substr($1, 2) + 0; if (t <= at) last = t } END { printf "%.6f", last - 1 }' "$dump")
reaches() { awk -v v="$1" -v least="$least" 'BEGIN { exit !(v >= least && least > 0) }'; }
# a line that was being written when the recorder was killed may be torn
last_s=$(tail -n 2 "$SCRATCH/killed.can" | awk '{ last = before; before = $1 } END { print last }' | tr -d '()')
[ -n "$(tail -c 1 "$SCRATCH/killed.can")" ] || last_s=$(tail -n 1 "$SCRATCH/killed.can" | tr -d '()' | cut -d' ' -f1)
reaches "$last_s" || echo "killed at $(cat "$SCRATCH/killed_at"), wanted $least, has $last_s, $(tail -n 1 "$SCRATCH/killed.can")"
reaches "$last_s"
check can_log_is_whole_to_the_last_second $?
"$tribend" import --lcm "$SCRATCH/killed.lcm" -o "$SCRATCH/killed_lcm.csv" >"$SCRATCH/import.out" 2>&1
reaches "$(awk '/^# time_zero/ { zero = $3 * 1e-6 } END { split($0, f, ","); printf "%.6f", zero + f[1] }' "$SCRATCH/killed_lcm.csv")"
check lcm_log_is_whole_to_the_last_second $?
[ -s "$SCRATCH/killed.csv.part" ] && [ "$(tail -n +7 "$SCRATCH/killed.csv.part" | wc -l)" -gt 100 ]
check run_log_is_there $?
board_end TERM
kill "$candump"
check_end

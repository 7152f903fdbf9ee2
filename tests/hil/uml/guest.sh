# What the scripts inside user-mode Linux share: the emulated board, a sender of commands, looking at what candump wrote.
# Sourced. Every wait has an end. Frames are taken apart here by hand, apart from the codec that is tested.
. tests/support/check.sh
tribend=$TRIBEND_BUILD/tribend
elf=$TRIBEND_BUILD/firmware/tribend.elf
node=1
bend_60=E828 # 1.0472 rad in units of 1e-4 rad
never=$SCRATCH/never
mkfifo "$never" && exec 9<>"$never" || exit 1 # a pipe that nobody writes to: waiting without another process

short_pause() { read -rt 0.1 -u 9 || true; }

# board_start NAME [options]: the emulated board on vcan0, its record in NAME.csv and its words in NAME.out once it ends. There
# is one processor in here: clients that keep to a schedule go first, and a board that is held up only counts its time slower.
# BOARD_NICE: by how much; a bridge takes two seconds of a board that is held up for its silence.
board_start() {
    local name=$1
    shift
    nice -n "${BOARD_NICE:-5}" "$tribend" board --elf "$elf" --bus vcan0 --record "$SCRATCH/$name.csv" "$@" >"$SCRATCH/$name.out" 2>&1 &
    board=$!
}
# board_ready: until the board that was just started has been through its self-test; what candump wrote of others is not it
board_ready() {
    local from
    from=$(frames "10$node")
    until_true more_frames "10$node" $((from + 12)) && until_true told_state 2 # 0.6 s, a state at least every 50 ms
}
board_end() { # SIGNAL
    kill "-$1" "$board" 2>/dev/null
    wait "$board" 2>/dev/null
}

# candump_start NAME: every frame into NAME.log, in candump's own log format; with room for what comes while it has to wait
candump_start() {
    dump=$SCRATCH/$1.log
    candump -r 8388608 -L vcan0 >"$dump" &
    candump=$!
    hears() { send_marker && short_pause && grep -qF " $marker" "$dump"; }
    until_true hears
}
send_marker() {
    marks=$(((${marks:-0} + 1) % 65536))
    printf -v marker '7F0#%04X' "$marks" # nobody's frame
    cansend vcan0 "$marker"
}
# mark: from here on, in the order of the bus; returns once candump has written all that was before
mark() { send_marker && until_true grep -qF " $marker" "$dump"; }
after_mark() { sed "1,/ ${1:-$marker}\$/d" "$dump" | grep -vF ' 7F0#'; } # [MARKER]

# bend_start RAW: BEND_COMMAND with real cansend, up to fifty times a second, until bend_stop
bend_start() {
    rm -f "$SCRATCH/bend.stop"
    (
        while [ ! -e "$SCRATCH/bend.stop" ]; do
            sequence=$(((sequence + 1) % 256))
            printf -v frame '05%d#%02X01%s00000000' "$node" "$sequence" "$1"
            cansend vcan0 "$frame"
            read -rt "${BEND_PAUSE:-0.02}" -u 9 || true
        done
    ) &
    bending=$!
}
bend_stop() {
    touch "$SCRATCH/bend.stop"
    wait "$bending"
}

# field_values IDENTIFIER BYTE BYTES [LAST]: an unsigned little-endian field of the frames with that identifier, in
# decimal, a line each; of the last LAST frames
field_values() {
    grep -F " $1#" "$dump" | tail -n "${4:-1000000}" | awk -v at="$2" -v bytes="$3" '
        { split($3, part, "#"); value = 0
          for (b = bytes - 1; b >= 0; b--)
              for (d = 1; d <= 2; d++)
                  value = 16 * value + index("0123456789ABCDEF", substr(part[2], 2 * (at + b) + d, 1)) - 1
          if (length(part[2]) >= 2 * (at + bytes)) print value }'
}
frames() { grep -cF " $1#" "$dump"; }
more_frames() { [ "$(frames "$1")" -ge "$2" ]; } # IDENTIFIER COUNT
# the bend, in degrees, that the board last told; "none" without one
bend_deg() { field_values "17$node" 0 2 "${1:-1}" | awk '{ s += $1; n++ } END { if (n) printf "%.3f\n", s / n * 1e-4 * 57.29578; else print "none" }'; }
state() { echo $(($(field_values "10$node" 0 1 1) % 16)); }
faults() { field_values "10$node" 3 4 1; }
highest_pressure_pa() {
    { field_values "11$node" 0 2 1; field_values "11$node" 2 2 1; field_values "11$node" 4 2 1; } |
        awk '{ v = $1 > 32767 ? $1 - 65536 : $1; if (v * 2 > most) most = v * 2 } END { print most + 0 }'
}
# near VALUE WANTED TOLERANCE
near() { awk -v v="$1" -v w="$2" -v t="$3" 'BEGIN { exit !(v != "none" && v - w <= t && w - v <= t) }'; }
told_bend() { near "$(bend_deg)" "$1" "$2"; }
# holds_bend WANTED TOLERANCE: each of the last hundred reports, half a second of the board's
holds_bend() {
    field_values "17$node" 0 2 100 | awk -v w="$1" -v t="$2" '{ d = $1 * 1e-4 * 57.29578 - w; if (d > t || d < -t) off++ }
        END { exit !(NR == 100 && !off) }'
}
told_state() { [ "$(frames "10$node")" -gt 0 ] && [ "$(state)" -eq "$1" ]; }

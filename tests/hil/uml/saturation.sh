# Inside user-mode Linux: the bridge on a full bus, as bench_bridge prints it; first as the bridge is, with the kernel handing over
# this board's frames alone, then with every frame in its CAN log; then real candump alone under the same load. What can be had in
# here depends on the machine outside: a system call costs ten times as much. SECONDS_LONG and RATE: how long, how full.
. tests/hil/uml/guest.sh
long=${SECONDS_LONG:-60} rate=${RATE:-8000}
sent() { cat /sys/class/net/vcan0/statistics/tx_packets; }
backlog_lost() {
    local lost
    read -r _ lost _ </proc/net/softnet_stat
    echo $((16#$lost))
}
load() {
    local lost status
    lost=$(backlog_lost)
    "$TRIBEND_BUILD/tests/bench/bench_bridge" "$tribend" vcan0 "$long" "$rate" "$@"
    status=$?
    echo "kernel     $(($(backlog_lost) - lost)) frames lost before any socket"
    return $status
}
echo "the bridge as it is, of all frames those of its board:"
load
check board_alone_is_taken_whole $?
echo "with a CAN log of every frame:"
load --can-log "$SCRATCH/full.can"
check every_frame_is_logged $?
before=$(sent)
candump_start full
"$TRIBEND_BUILD/tests/bench/bench_bridge" - vcan0 "$long" "$rate"
sleep 5 # what candump has not yet written
kill "$candump"
wait "$candump" 2>/dev/null
echo "candump    $(wc -l <"$dump") of $(($(sent) - before)) frames, alone"
check_end

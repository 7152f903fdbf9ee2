# Inside user-mode Linux: the bridge on a saturated bus, with a bare candump beside. Figures are printed; what fails is a frame
# that the bridge neither took nor counted as dropped by the kernel, and memory that grows. SECONDS_LONG: how long. On a machine that
# is busy with other things, cangen comes to fewer frames than the 8,000 a second of a full 1 Mbit/s bus.
. tests/hil/uml/guest.sh
long=${SECONDS_LONG:-60}
node=7 # cangen's identifiers stay clear of it
"$tribend" bridge --bus vcan0 --node $node --quiet >"$SCRATCH/bridge.out" 2>&1 &
bridge=$!
candump -L vcan0 >"$SCRATCH/load.log" &
candump=$!
sleep 1
resident() { awk '/^VmRSS/ { print $2 }' "/proc/$bridge/status"; }
before=$(resident)
# cangen sleeps between frames, so several share the load; every fourth is telemetry that is published
for generator in 1 2 3 4; do
    cangen vcan0 -g "${GAP_MS:-0.5}" -I "$([ "$generator" = 1 ] && echo 127 || echo 6A$generator)" -L 8 -D i >/dev/null 2>&1 &
    generators+=" $!"
done
sleep "$long"
kill $generators
wait $generators 2>/dev/null
sent=$(cat /sys/class/net/vcan0/statistics/tx_packets)
after=$(resident)
sleep 15 # what the sockets still hold
kill "$bridge"
wait "$bridge"
kill "$candump"
received=$(awk '$1 == "frames_received" { print $2 }' "$SCRATCH/bridge.out")
overflowed=$(awk '$1 == "frames_overflowed" { print $2 }' "$SCRATCH/bridge.out")
own=$(awk '$1 == "frames_sent" { print $2 }' "$SCRATCH/bridge.out")
dumped=$(wc -l <"$SCRATCH/load.log")
echo "bus        $sent frames in $long s, $((sent / long)) a second"
echo "bridge     $received received, $own sent, $overflowed dropped by the kernel; resident $before kB, then $after kB"
echo "candump    $dumped received"
grep '^latency' "$SCRATCH/bridge.out"
[ $((received + own + overflowed)) -ge "$sent" ]
check every_frame_is_taken_or_counted $?
[ "$after" -le $((before + 256)) ]
check memory_is_flat $?
check_end

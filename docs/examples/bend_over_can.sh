# A bend of 60 degrees over a real CAN socket, and what the board then says of its bend (units of 1e-4 rad, low byte first).
build/tribend board --bus vcan0 --quiet &
candump -n 20 vcan0,101:7FF >/dev/null # a second of its state: the self-test is over
for sequence in {1..20}; do
    cansend vcan0 "$(printf '051#%02X01E82800000000' "$sequence")"
done
candump -n 3 vcan0,170:7F0
kill %1
wait

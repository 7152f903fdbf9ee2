#!/bin/bash
# docs/json.md: its commands print one JSON object each, alone and in SI units; every field in them is on the page, and no other.
build=${TRIBEND_BUILD:-build}
tribend=$build/tribend
. tests/support/check.sh
scratch=$(mktemp -d)
board=
trap '[ -z "$board" ] || kill "$board" 2>/dev/null; wait 2>/dev/null; rm -rf "$scratch"' EXIT
shown="$scratch/said"

# object NAME CODE COMMAND..: standard output is one object, and the exit code that
object() {
    local name=$1 code=$2
    shift 2
    "$@" >"$scratch/$name.json" 2>"$scratch/said" </dev/null
    [ $? -eq "$code" ] && python3 -c 'import json, sys; assert isinstance(json.load(open(sys.argv[1])), dict)' "$scratch/$name.json" 2>>"$scratch/said"
    check "${name}_is_one_object" $?
}
# holds NAME EXPRESSION: in Python, of the object o
holds() {
    python3 -c 'import json, math, sys; o = json.load(open(sys.argv[1])); assert eval(sys.argv[2].replace(chr(10), chr(32))), o' "$scratch/$1.json" "$2" 2>"$scratch/said"
}
commands=0
while read -r command; do
    read -r _ name _ <<<"$command"
    commands=$((commands + 1))
    command=${command//build\/json-run/$scratch\/json-run}
    # shellcheck disable=SC2086
    object "$name" 0 ${command/build\//$build/}
done < <(sed -n 's/^    //p' docs/json.md)
[ "$commands" -eq 7 ]
check every_command_was_run $?
holds bend 'o["command"]["kind"] == "bend" and abs(o["followed"]["bend_rad"] - math.radians(40)) < 0.01
    and abs(o["followed"]["direction_rad"] - math.radians(30)) < 0.02 and 0 < o["followed"]["settled_s"] < 2
    and abs(o["followed_s"] - 3) < 0.01 and o["state"] == "ACTIVE" and o["vented_s"] > 0 and not o["interrupted"] and o["record"] is None'
check bend_is_told_in_radians $?
holds pressure 'o["command"]["pressure_pa"] == [4000, 0, 0] and abs(o["pressure_estimate_pa"][0] - 4000) < 200'
check pressure_is_told_in_pascals $?
holds run 'o["command"]["kind"] == "plan" and o["command"]["plan"].endswith("creep_holds.yaml") and o["followed"] is None and abs(o["followed_s"] - 32) < 0.01'
check plan_is_told_by_its_file $?
object fault 6 "$tribend" bend 40deg --for 3s --drill tip-lost@1s --drill sensor-range@2s --json --record "$scratch/fault.csv"
holds fault 'o["state"] == "FAULT" and o["faults"] and o["record"].endswith("fault.csv")'
check fault_is_told_in_the_object $?
"$tribend" bend 40deg --for 1000min --json --record "$scratch/long.csv" >"$scratch/interrupted.json" 2>"$scratch/said" &
host=$!
until_true test -s "$scratch/long.csv.part"
kill -INT $host
wait $host
[ $? -eq 130 ] && holds interrupted 'o["interrupted"] and o["vented_s"] > 0'
check interrupted_is_told_in_the_object $?

# a board on a bus
"$build/tests/link/stub/board_stub" "$scratch/bus" >"$scratch/states" 2>&1 &
board=$!
until_true grep -qs SAFE "$scratch/states"
object bus 0 "$tribend" bend 20deg --for 1s --json --bus "unix:$scratch/bus"
"$tribend" bend 30deg --for 1000min -q --bus "unix:$scratch/bus" >"$scratch/first" 2>&1 &

until_active() { tail -n 1 "$scratch/states" | grep -q ACTIVE; }
until_true until_active
object hold 0 "$tribend" hold --for 1s --json --bus "unix:$scratch/bus"
holds hold 'o["state"] == "HOLD" and max(o["pressure_pa"]) > 2000 and o["counters"]["received"] > 0'
check hold_is_told_while_it_held $?

# fields of the objects and of the page
python3 - "$scratch"/*.json >"$scratch/fields" <<'PYTHON'
import json, sys
def names(value):
    if isinstance(value, dict):
        for name, inner in value.items():
            print(name)
            names(inner)
for path in sys.argv[1:]:
    names(json.load(open(path)))
PYTHON
sed -n '/^## /,$p' docs/json.md | grep -oE '`[a-z_0-9]+`' | tr -d '`' | sort -u >"$scratch/told"
sort -u "$scratch/fields" >"$scratch/printed"
comm -23 "$scratch/printed" "$scratch/told" | sed 's/^/docs\/json.md lacks /' >"$scratch/said"
[ ! -s "$scratch/said" ] && [ "$(wc -l <"$scratch/printed")" -gt 60 ]
check every_field_is_on_the_page $?
comm -13 "$scratch/printed" "$scratch/told" | grep -vxE 'bend|pressure|run|plan|vent|clear|record|null' >"$scratch/said"
[ ! -s "$scratch/said" ]
check every_name_on_the_page_is_a_field $?
check_end

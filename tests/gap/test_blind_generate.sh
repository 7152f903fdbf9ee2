#!/bin/bash
# The blind cases: the same seed gives the same bytes, every corpus can be drawn, and what the diagnosis sees of a case
# carries no hint.
build=${TRIBEND_BUILD:-build}
generate=$build/tests/gap/blind/blind_generate
table=tables/paper-semicircle.tbt
passed=0 failed=0
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# check NAME command...: the command succeeds
check() {
    local name=$1
    shift
    echo "[ RUN      ] $name"
    if "$@" >"$scratch/said" 2>&1; then
        echo "[       OK ] $name"
        passed=$((passed + 1))
    else
        cat "$scratch/said"
        echo "[  FAILED  ] $name"
        failed=$((failed + 1))
    fi
}
draw() { # folder seed corpus count
    "$generate" --seed "$2" --corpus "$3" --count "$4" --seconds 6 --table "$table" --module paper-semicircle --out "$scratch/$1"
}
same_seed_same_bytes() {
    draw one 4 single 3 && draw two 4 single 3 && diff -r "$scratch/one" "$scratch/two" &&
        [ "$(find "$scratch/one/logs" -name '*.csv' | wc -l)" -eq 6 ]
}
another_seed_other_cases() {
    draw three 5 single 3 && [ -z "$(find "$scratch/one/truth" "$scratch/three/truth" -name '*.json' -printf '%f\n' | sort | uniq -d)" ]
}
every_corpus_can_be_drawn() {
    local corpus
    for corpus in local pair unknown ablation nogap recalibrate geometry confounded mixed; do
        draw all 6 "$corpus" 1 || return 1
    done
}
names_say_nothing() {
    ! find "$scratch/all/logs" "$scratch/one/logs" -type f | sed 's,.*/,,' | grep -vE '^[0-9a-f]{8}-[12]\.csv$'
}
# Beside the rate, which is random in every case, all logs begin alike and last as long.
metadata_say_nothing() {
    local log
    for log in "$scratch"/all/logs/*.csv "$scratch"/one/logs/*.csv; do
        grep '^#' "$log" | sed 's/^# rate: [0-9.]* Hz$/# rate/'
        tail -n 1 "$log" | cut -d, -f1
    done | sort | uniq -c | tee "$scratch/said" | wc -l | grep -qx 6
}
a_row_inside_every_period() {
    awk -F, '/^[0-9]/ { ms = int(1000 * $1 + 0.5); if (ms % 10) seen[int(ms / 10)] = 1 }
             END { for (k = 0; k < 600; k++) if (!seen[k]) { print "no row in period", k; exit 1 } }' \
        "$(find "$scratch/one/logs" -name '*.csv' | LC_ALL=C sort | head -n 1)"
}
bad_tables_are_refused() {
    head -c 1000 "$table" >"$scratch/short.tbt"
    "$generate" --table "$scratch/short.tbt" --out "$scratch/none"
    [ $? -eq 3 ] && [ ! -e "$scratch/none" ] && { "$generate" --table "$table" --module other --out "$scratch/none"; [ $? -eq 3 ]; }
}
part_of_a_corpus_is_the_same_cases() {
    "$generate" --seed 4 --corpus single --first 1 --count 2 --seconds 6 --table "$table" --module paper-semicircle --out "$scratch/part" &&
        [ "$(find "$scratch/part/truth" -name '*.json' | wc -l)" -eq 2 ] || return 1
    local truth id
    for truth in "$scratch"/part/truth/*.json; do
        id=$(basename "$truth" .json)
        cmp "$truth" "$scratch/one/truth/$id.json" && cmp "$scratch/part/logs/$id-2.csv" "$scratch/one/logs/$id-2.csv" || return 1
    done
}
cat >"$scratch/plan.yaml" <<'PLAN'
module: paper-semicircle
steps:
  - { for: 1s, pressure: [20mbar, 0mbar, 0mbar] }
  - { for: 2s, ramp_to: [20mbar, 40mbar, 0mbar] }
  - { for: 1s, sine: { chambers: [3], amplitude: 1kPa, mean: 2kPa, period: 1s } }
  - { for: 1s, bend: 30deg, toward: 90deg }
PLAN
follow() { # folder truth plan
    "$generate" --truth "$2" --plan "$3" --table "$table" --module paper-semicircle --out "$scratch/$1"
}
# Commands at times: the plan's, after a second of rest. The random run lasts as long and does something else.
a_plan_is_followed() {
    local truth id
    truth=$(find "$scratch/all/truth" -name '*.json' -exec grep -l '"corpus": "nogap"' {} + | head -n 1)
    id=$(basename "$truth" .json)
    follow next "$truth" "$scratch/plan.yaml" && follow again "$truth" "$scratch/plan.yaml" && diff -r "$scratch/next" "$scratch/again" || return 1
    [ "$(tail -n 1 "$scratch/next/planned/$id.csv" | cut -d, -f1)" = 7.000000 ] &&
        [ "$(tail -n 1 "$scratch/next/random/$id.csv" | cut -d, -f1)" = 7.000000 ] || return 1
    ! cmp -s "$scratch/next/planned/$id.csv" "$scratch/next/random/$id.csv" && awk -F, '
        function near(a, b) { return a - b < 60 && b - a < 60 }
        /^[0-9]/ && $1 > 1.5 && $1 < 1.9 && !(near($5, 2000) && near($6, 0)) { print "step:", $0; bad = 1 }
        /^[0-9]/ && $1 > 2.9 && $1 < 3.1 && !(near($5, 2000) && near($6, 2000 + 2000 * ($1 - 3))) { print "ramp:", $0; bad = 1 }
        /^[0-9]/ && $1 > 4.2 && $1 < 4.3 && !(near($5, 0) && near($7, 3000)) { print "sine:", $0; bad = 1 }
        /^[0-9]/ && $1 > 5.8 && $1 < 6 && $5 + $6 + $7 < 1000 { print "bend:", $0; bad = 1 }
        END { exit bad }' "$scratch/next/planned/$id.csv"
}
bad_plans_name_their_line() {
    local truth
    truth=$(find "$scratch/all/truth" -name '*.json' | head -n 1)
    sed 's/pressure: \[20mbar/pressure: [20furlong/' "$scratch/plan.yaml" >"$scratch/bad.yaml"
    follow bad "$truth" "$scratch/bad.yaml" 2>"$scratch/why"
    [ $? -eq 3 ] && grep -q 'bad.yaml:3: a number with its unit' "$scratch/why" && [ ! -e "$scratch/bad/planned" ] || return 1
    sed '/"draw"/,/}/d' "$truth" | sed 's/^  },$/  }/' >"$scratch/undrawn.json"
    follow bad "$scratch/undrawn.json" "$scratch/plan.yaml" 2>"$scratch/why"
    [ $? -eq 3 ] && grep -q 'undrawn.json' "$scratch/why"
}
check same_seed_same_bytes same_seed_same_bytes
check part_of_a_corpus_is_the_same_cases part_of_a_corpus_is_the_same_cases
check another_seed_other_cases another_seed_other_cases
check every_corpus_can_be_drawn every_corpus_can_be_drawn
check a_plan_is_followed a_plan_is_followed
check bad_plans_name_their_line bad_plans_name_their_line
check names_say_nothing names_say_nothing
check metadata_say_nothing metadata_say_nothing
check a_row_inside_every_period a_row_inside_every_period
check bad_tables_are_refused bad_tables_are_refused
echo "[  PASSED  ] $passed test(s)."
[ "$failed" -eq 0 ]

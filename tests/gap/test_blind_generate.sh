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
check same_seed_same_bytes same_seed_same_bytes
check another_seed_other_cases another_seed_other_cases
check every_corpus_can_be_drawn every_corpus_can_be_drawn
check names_say_nothing names_say_nothing
check metadata_say_nothing metadata_say_nothing
check a_row_inside_every_period a_row_inside_every_period
check bad_tables_are_refused bad_tables_are_refused
echo "[  PASSED  ] $passed test(s)."
[ "$failed" -eq 0 ]

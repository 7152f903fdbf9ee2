#!/bin/bash
# The scorer, on truths and answers made by hand.
build=${TRIBEND_BUILD:-build}
score=$build/tests/gap/blind/blind_score
passed=0 failed=0
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
mkdir "$scratch/truth" "$scratch/answers"

truth() { # id corpus verdict gap effects [removed]
    echo "{\"id\": \"$1\", \"corpus\": \"$2\", \"verdict\": \"$3\", \"gap_ratio\": $4, \"effects\": [$5], \"removed\": ${6:-null}}" \
        >"$scratch/truth/$1.json"
}
answer() { # id verdict stage chambers effects group
    echo "{\"verdict\": \"$2\", \"locus\": {\"stage\": \"$3\", \"chambers\": [$4]}, \"effects\": [$5], \"group\": [$6]}" \
        >"$scratch/answers/$1.json"
}
creep='{"name": "creep", "stage": "body", "chamber": 0, "parameters": {"amplitude": 0.1, "time_constant": 2}}'
leak='{"name": "chamber_leak", "stage": "valve", "chamber": 2, "parameters": {"conductance": 1e-11}}'
said_creep='{"name": "creep", "stage": "body", "probability": 0.9, "parameters": {"amplitude": {"value": 0.11, "low": 0.09, "high": 0.12}}}'
said_leak='{"name": "chamber_leak", "stage": "valve", "probability": 0.8, "parameters": {"conductance": {"value": 2e-11, "low": 1.5e-11, "high": 3e-11}}}'
truth a1 single effect 10 "$creep"
answer a1 effect body "" "$said_creep" ""
truth a2 single effect 10 "$leak"
answer a2 effect valve 2 "$said_creep, $said_leak" "" # the leak is there, but not on top
truth a3 single effect 10 "$leak"
answer a3 effect valve 1 "$said_leak" ""
truth a4 single effect 2 "$creep" # faint: abstaining is no failure
answer a4 no-gap "" "" "" ""
truth b1 pair effects 10 "$creep, $leak"
answer b1 effects body "" "$said_creep, $said_leak" ""
truth b2 pair effects 10 "$creep, $leak"
answer b2 effect body "" "$said_creep" ""
truth c1 unknown unknown 10 '{"name": "curl", "stage": "body"}'
answer c1 unknown body "" "" ""
truth c2 nogap no-gap 0 ""
answer c2 effect body "" "$said_creep" ""
truth c3 recalibrate recalibrate 0 "" # no answer at all
truth d1 ablation unknown 10 "$creep" '"creep"'
answer d1 effect body "" '{"name": "hysteresis", "stage": "body", "probability": 0.95}' ""
truth d2 ablation unknown 10 "$creep" '"creep"'
answer d2 effect "tip sensor" "" '{"name": "tip_offset", "stage": "tip sensor", "probability": 0.95}' ""
truth e1 confounded group 10 "$leak"
answer e1 group valve 2 "" '"chamber_leak", "line_resistance"'
# A second group, of three; the plan leaves the right effect, and two of three; the random experiment a wrong name, and two.
truth e2 confounded group 10 "$creep"
answer e2 group body "" "$said_creep" '"creep", "hysteresis", "mullins", "creep"'
mkdir "$scratch/planned" "$scratch/random"
mv "$scratch/answers" "$scratch/before"
answer_to() { # folder, then as answer
    mkdir "$scratch/answers"
    answer "${@:2}"
    mv "$scratch/answers/$2.json" "$scratch/$1" && rmdir "$scratch/answers"
}
answer_to planned e1 effect valve 2 "$said_leak" ""
answer_to planned e2 group body "" "$said_creep" '"creep", "hysteresis"'
answer_to random e1 effect valve 2 '{"name": "line_resistance", "stage": "valve", "probability": 0.9}' ""
answer_to random e2 group body "" "$said_creep" '"creep", "mullins"'
mv "$scratch/before" "$scratch/answers"
"$score" --truth "$scratch/truth" --answers "$scratch/answers" --planned "$scratch/planned" --random "$scratch/random" \
    --csv "$scratch/confusion.csv" >"$scratch/table"
code=$?

# says NAME PATTERN: a line of the table, with runs of blanks as one
says() {
    echo "[ RUN      ] $1"
    if sed 's/  */ /g' "$scratch/table" | grep -qE "$2"; then
        echo "[       OK ] $1"
        passed=$((passed + 1))
    else
        cat "$scratch/table"
        echo "[  FAILED  ] $1"
        failed=$((failed + 1))
    fi
}
says top_of_the_list_counts 'single, gap at least 3 x floor .* 2 of 3 '
says truth_lower_in_the_list_is_in_the_group '^ right group .* 3 of 3 '
says interval_is_wilsons 'single, gap at least 3 x floor .* 20\.8 to 93\.9 %'
says stages 'locus, stage .* 3 of 3 '
says chambers 'locus, chamber.* 1 of 2 '
says both_of_a_pair 'pairs: both right .* 1 of 2 '
says one_of_a_pair 'pairs: at least one and none false .* 2 of 2 '
says unknown_detected 'unknown detected .* 1 of 1 '
says a_name_on_clean_data 'named effect on no-gap data .* 1 of 1 .* missed'
says a_near_family_will_do 'true entry removed.* 1 of 2 '
says groups 'a group with the truth in it .* 2 of 2 '
says plans_that_halve 'gap plan: its experiment halves the group .* 1 of 2 .* 9\.5 to 90\.5 % . missed'
says random_ones_that_halve 'a random one of equal length does .* 0 of 2 '
says which_leaves_less 'after the plan in 1, after the random one in 0; groups without the truth: 0$'
says error_of_parameters 'parameter error, median .* 10 %'
says coverage 'interval covers the truth .* 3 of 6 '
says abstaining_on_faint_data_is_no_failure '^6 of 13 cases$'
says missing_answers_are_told '^1 cases have no answer$'
echo "[ RUN      ] confusion_matrix_is_written"
if [ "$code" -eq 0 ] && head -n 1 "$scratch/confusion.csv" | grep -q '^truth,creep'; then
    echo "[       OK ] confusion_matrix_is_written"
    passed=$((passed + 1))
else
    cat "$scratch/confusion.csv"
    echo "[  FAILED  ] confusion_matrix_is_written"
    failed=$((failed + 1))
fi
echo "[ RUN      ] strict_fails_only_where_a_miss_is_sure"
"$score" --truth "$scratch/truth" --answers "$scratch/answers" --strict >/dev/null
if [ $? -eq 1 ]; then # one name on one case without a gap: the interval starts at 21 %, over 3 %
    echo "[       OK ] strict_fails_only_where_a_miss_is_sure"
    passed=$((passed + 1))
else
    echo "[  FAILED  ] strict_fails_only_where_a_miss_is_sure"
    failed=$((failed + 1))
fi
echo "[  PASSED  ] $passed test(s)."
[ "$failed" -eq 0 ]

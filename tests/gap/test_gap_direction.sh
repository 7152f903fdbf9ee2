#!/bin/bash
# The founding paper's gap, by the commands of docs/gap.md ("The paper's gap"): its model's bend lags behind the measured one,
# which it takes for missing viscoelasticity. Recorded with creep, the diagnosis must say creep, in the body, and in which
# direction; without, it must say that nothing is missing; and with the transitions cut out of the recording and without
# duties, what pressure readings leave open must count as noise.
build=${TRIBEND_BUILD:-build}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
TRIBEND_TABLE=$PWD/tables/paper-semicircle.tbt
export TRIBEND_TABLE
. tests/support/check.sh
shown="$out/*.txt"
holds() { # condition on numbers, for awk
    awk "BEGIN {exit !($1)}"
}
diagnose() { # name
    "$build/tribend" gap diagnose "$out/$1.csv" --json "$out/$1.json" --html "$out/$1.html" >"$out/$1.txt" 2>"$out/$1.progress"
}
# The first number of a key of the JSON report.
number() { # name, key
    sed -n "s/^ *\"$2\": \(-\{0,1\}[0-9.e+-]*\),\{0,1\}$/\1/p" "$out/$1.json" | head -1
}
"$build/tribend" run docs/examples/creep_holds.yaml -q --effect creep:amplitude=0.08,time_constant=1.2 \
    --record "$out/creep.csv" >"$out/run.txt" 2>&1 &&
    "$build/tribend" run docs/examples/creep_holds.yaml -q --record "$out/plain.csv" >>"$out/run.txt" 2>&1
check both_are_recorded $?

diagnose creep
grep -q '^verdict *effect:' "$out/creep.txt" && grep -q '^where *body' "$out/creep.txt" && grep -q '^which *creep' "$out/creep.txt"
check creep_in_the_body_is_named $?
grep -q "^direction measured bend exceeds the nominal model's by .* at the end of 3 holds.*goes on bending.*the model lags" "$out/creep.txt"
check the_report_says_that_the_model_lags $?
end_deg=$(number creep end_deg) after_deg=$(number creep just_after_deg)
holds "${end_deg:-0} > 2 && ${end_deg:-0} < 6 && ${after_deg:-9} > 0 && ${after_deg:-9} < 0.5 * ${end_deg:-0}"
check and_by_how_much $?
tau_s=$(sed -n '/"time_constant": {/,/}/s/^ *"value": \([0-9.]*\),*$/\1/p' "$out/creep.json" | tail -1)
holds "${tau_s:-0} > 1.05 && ${tau_s:-0} < 1.35"
check and_for_how_long $?
# nominal model, then recalibrated, then with creep: on held-out data
awk '/^ +r2_angle/ {found = 1; gsub(/\([^)]*\)/, ""); exit !($2 > 1 && $3 > 0.3 && $4 < 0.05)} END {if (!found) exit 1}' "$out/creep.txt"
check creep_closes_what_recalibration_does_not $?
grep -q '<h3>Direction</h3>' "$out/creep.html" && grep -q 'the model lags' "$out/creep.html"
check the_page_says_so_too $?

diagnose plain
grep -q '^verdict *no-gap:' "$out/plain.txt"
check long_rests_make_no_gap $?
grep -q '^direction.*does not change while a pressure is held' "$out/plain.txt"
check nor_a_direction $?

# 20 Hz, no duties, and 0.6 s after every step cut out, as in recordings that people tidy up.
awk -F, -v OFS=, -v segments="$out/segments" '
/^#/ {if (!/^# rate/) print; next}
!header {
    header = 1
    for (i = 1; i <= NF; i++) if ($i ~ /^(time_s|p[123]_pa|tip_[xyz]_m|tip_q[wxyz])$/) keep[++kept] = i
    row()
    next
}
function row(k) {
    for (k = 1; k <= kept; k++) printf "%s%s", $(keep[k]), k < kept ? "," : "\n"
}
{
    time = $1
    if ($(keep[5]) == "" || time < next_time) next
    for (k = split("2 8 12 18 22 28", step, " "); k > 0; k--) if (time > step[k] - 1e-9 && time < step[k] + 0.6) {
        cut = 1
        next
    }
    next_time = time + 0.0499
    if (cut) {
        off += time - last - 0.05
        starts = starts sprintf(" %.3f", time - off)
        cut = 0
    }
    last = time
    $1 = sprintf("%.6f", time - off)
    row()
}
END {print "# segments: 0.000" starts >segments}' "$out/creep.csv" >"$out/rows" &&
    { head -1 "$out/rows" && cat "$out/segments" && tail -n +2 "$out/rows"; } >"$out/cut.csv"
diagnose cut
grep -q '^verdict *effect:' "$out/cut.txt" && grep -q '^which *creep' "$out/cut.txt"
check creep_is_found_across_cuts $?
# near ninety degrees readings at 20 Hz leave open about a degree: the floor says so, and what is left is no more than that
awk '/^ +r2_angle/ {found = 1; gsub(/\([^)]*\)/, ""); exit !($5 > 0.3 && $5 < 1.6 && $4 < 1.5 * $5)} END {if (!found) exit 1}' "$out/cut.txt"
check the_floor_holds_what_readings_leave_open $?
# without the segments the readings are smoothed through the cuts: what they leave open is then another number
grep -v '^# segments' "$out/cut.csv" >"$out/unmarked.csv"
diagnose unmarked
floor=$(awk '/^ +r2_angle/ {gsub(/\([^)]*\)/, ""); print $5}' "$out/cut.txt")
through=$(awk '/^ +r2_angle/ {gsub(/\([^)]*\)/, ""); print $5}' "$out/unmarked.txt")
holds "$through > 0 && ($through < 0.95 * $floor || $through > 1.05 * $floor)"
check segments_are_read $?
echo "           floor of the cut recording: $floor deg"
check_end

#!/bin/bash
# Bad input to both programs: each has its own message and exit code, and leaves nothing half-written.
build=${TRIBEND_BUILD:-build}
tribend=$build/tribend tables=$build/tribend-tables
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
mkdir -p "$scratch/modules" "$scratch/materials" "$scratch/out"
cp tables/materials/*.yaml "$scratch/materials/"
passed=0 failed=0

# expect NAME EXIT_CODE WORDS_IN_MESSAGE command...: also checks that $scratch/out stays empty.
expect() {
    local name=$1 code=$2 words=$3 status
    shift 3
    echo "[ RUN      ] $name"
    "$@" >"$scratch/stdout" 2>"$scratch/stderr"
    status=$?
    if [ "$status" -eq "$code" ] && grep -qiE -- "$words" "$scratch/stderr" && [ -z "$(ls -A "$scratch/out")" ]; then
        echo "[       OK ] $name"
        passed=$((passed + 1))
    else
        echo "exit $status, expected $code; wanted /$words/ in:"
        cat "$scratch/stderr"
        ls -A "$scratch/out"
        echo "[  FAILED  ] $name"
        failed=$((failed + 1))
        rm -rf "$scratch/out/"*
    fi
}
# module NAME SED_SCRIPT: a module like the reference one, changed
module() {
    sed -E "$2" tables/modules/paper-semicircle.yaml >"$scratch/modules/$1.yaml"
    cmp -s tables/modules/paper-semicircle.yaml "$scratch/modules/$1.yaml" && echo "the change to $1 changed nothing"
    echo "$scratch/modules/$1.yaml"
}
build_table() { "$tables" build "$1" -o "$scratch/out/table.tbt"; }

# --- module and material files
expect module_key_missing 3 'radius_m' build_table "$(module missing '/radius_m/d')"
expect module_key_unknown 3 'colour' build_table "$(module unknown 's/^outer_diameter_m.*/&\ncolour: red/')"
expect module_limit_missing 3 'burst_pressure_pa' build_table "$(module limit '/burst/d')"
expect radius_negative 3 'radius_m.*-0.0037' build_table "$(module negative 's/radius_m: 0/radius_m: -0/')"
expect chambers_overlap 3 'overlap' build_table "$(module overlap 's/radius_m: .*/radius_m: 0.0070/; s/0\.0073/0.0053/; s/semicircle/circle/')"
expect chamber_leaves_module 3 'leaves|outside' build_table "$(module leaves 's/0\.0073/0.0103/')"
expect shape_unknown 3 'shape|triangle' build_table "$(module shape 's/shape: semicircle/shape: triangle/')"
expect number_with_words_behind 3 "trailing.yaml:[0-9]+: length_m: '0.06banana' is not a number" build_table "$(module trailing 's/^length_m: .*/length_m: 0.06banana/')"
expect number_with_unit 3 "unitful.yaml:[0-9]+: radius_m: '3.7mm' is not a number" build_table "$(module unitful 's/radius_m: .*/radius_m: 3.7mm/')"
expect number_malformed 3 'length_m' build_table "$(module number 's/^length_m: .*/length_m: long/')"
expect caps_longer_than_module 3 'cap|length' build_table "$(module caps 's/proximal_m: .*/proximal_m: 0.070/')"
expect sector_without_opening 3 'opening_deg' build_table "$(module opening 's/shape: semicircle/shape: sector/')"
expect ring_without_inner_radius 3 'inner_radius_m' build_table "$(module ring 's/shape: semicircle/shape: ring-sector/; s/radius_m: .*/&\n        opening_deg: 60/')"
expect bore_opens_chamber 3 'bore' build_table "$(module bore 's/^length_m.*/&\nbore_diameter_m: 0.020/')"
expect bore_too_wide 3 'bore_diameter_m.*outer' build_table "$(module wide 's/^length_m.*/&\nbore_diameter_m: 0.030/')"
layer='layers:\n  - inner_radius_m: 0.0115\n    outer_radius_m: 0.0125\n    material: ecoflex-0030-measured\n'
expect layer_outside 3 'layer 1.*no ring' build_table "$(module layer "s/^limits:/${layer//0.0125/0.0135}&/")"
expect layer_cut_by_chamber 3 'cuts the edge of layer 1' build_table "$(module cutlayer "s/^limits:/${layer//0.0115/0.0090}&/")"
expect corrugation_incomplete 3 'corrugation_material' build_table "$(module corrugation "s/^limits:/$layer    corrugation_fraction: 0.4\n&/")"
expect layer_material_unknown 3 'unobtainium' build_table "$(module layermaterial "s/^limits:/${layer//ecoflex-0030-measured/unobtainium}&/")"
expect burst_below_working 3 'burst' build_table "$(module burst 's/burst_pressure_pa: .*/burst_pressure_pa: 1000/')"
expect material_unknown 3 'unobtainium' build_table "$(module material 's/^material: .*/material: unobtainium/')"
expect yaml_broken 3 'broken.yaml' build_table "$(module broken 's/^chambers:/chambers: [/')"
expect module_file_missing 3 'no-such-module' build_table no-such-module
sed 's/^law: .*/law: hooke/' tables/materials/ecoflex-0030-positive.yaml >"$scratch/materials/bad-law.yaml"
expect law_unknown 3 'law|hooke' "$tables" solve paper-semicircle --material "$scratch/materials/bad-law.yaml" --to 5deg
sed '/^bulk/d' tables/materials/ecoflex-0030-positive.yaml >"$scratch/materials/no-bulk.yaml"
expect material_key_missing 3 'bulk_modulus_pa' "$tables" solve paper-semicircle --material "$scratch/materials/no-bulk.yaml" --to 5deg
sed '/^exponents/d' tables/materials/ecoflex-0030-measured-ogden.yaml >"$scratch/materials/no-exponents.yaml"
expect ogden_without_exponents 3 'one exponent for each' "$tables" material "$scratch/materials/no-exponents.yaml"
sed 's/^law: .*/law: yeoh\nexponents: [1, 2, 3]/' tables/materials/ecoflex-0030-positive.yaml >"$scratch/materials/exponents.yaml"
expect exponents_of_no_use 3 'only ogden' "$tables" material "$scratch/materials/exponents.yaml"
sed 's/^density_kgpm3: .*/density_kgpm3: 1070kg/' tables/materials/ecoflex-0030-positive.yaml >"$scratch/materials/heavy.yaml"
expect material_number_with_unit 3 "heavy.yaml:[0-9]+: density_kgpm3: '1070kg' is not a number" "$tables" material "$scratch/materials/heavy.yaml"
sed 's/^coefficients_pa: *.[0-9]*/coefficients_pa: [1e4Pa/' tables/materials/ecoflex-0030-positive.yaml >"$scratch/materials/list.yaml"
expect material_number_in_a_list_with_unit 3 "list.yaml:[0-9]+: coefficients_pa: '1e4Pa' is not a number" "$tables" material "$scratch/materials/list.yaml"
expect material_name_unknown 3 'unobtainium' "$tables" material unobtainium
expect output_folder_missing 5 '/nowhere' "$tables" solve paper-semicircle --to 2deg --csv /nowhere/path.csv

# --- tables
reference=tables/paper-semicircle.tbt
head -c 100000 "$reference" >"$scratch/truncated.tbt"
head -c 10 "$reference" >"$scratch/short.tbt"
: >"$scratch/empty.tbt"
cp "$reference" "$scratch/flipped.tbt"
byte=$(od -An -tu1 -j 60000 -N 1 "$scratch/flipped.tbt")
printf "\\x$(printf %x $((byte ^ 16)))" | dd of="$scratch/flipped.tbt" bs=1 seek=60000 conv=notrunc status=none
for file in truncated short empty; do
    expect "table_$file" 3 "$file.tbt.*(short|cut|size|bytes)" "$tribend" bend 60deg --table "$scratch/$file.tbt" --record "$scratch/out/run.csv"
done
expect table_bit_flipped 3 'flipped.tbt.*CRC' "$tribend" bend 60deg --table "$scratch/flipped.tbt" --record "$scratch/out/run.csv"
expect table_bit_flipped_show 3 'CRC' "$tables" show "$scratch/flipped.tbt"
expect table_of_another_module 3 'paper-semicircle.*paper-circle' "$tribend" bend 60deg --module paper-circle --table "$reference" --record "$scratch/out/run.csv"
expect table_missing 3 'nothing.tbt' "$tribend" status --table "$scratch/nothing.tbt"
expect table_is_no_table 3 'not a bend table' "$tribend" status --table README.md
expect table_is_a_folder 3 'tables' "$tribend" status --table tables

# --- run logs
"$tribend" bend 20deg --for 1s -q --record "$scratch/run.csv" >/dev/null || failed=$((failed + 1))
awk -F, -v OFS=, '/^#/ { print; next } /^time_s/ { for (i = 1; i <= NF; i++) if ($i == "p1_pa") drop = i }
    { line = ""; for (i = 1; i <= NF; i++) if (i != drop) line = line (line == "" ? "" : OFS) $i; print line }' \
    "$scratch/run.csv" >"$scratch/no-p1.csv"
expect log_column_missing 3 'p1_pa' "$tribend" plot "$scratch/no-p1.csv" -o "$scratch/out/run.png"
head -c 5000 "$scratch/run.csv" >"$scratch/cut.csv"
expect log_cut_off 3 'cut.csv:[0-9]+' "$tribend" plot "$scratch/cut.csv" -o "$scratch/out/run.png"
expect log_missing 3 'none.csv' "$tribend" plot "$scratch/none.csv" -o "$scratch/out/run.png"
expect log_is_a_table 3 'no run log' "$tribend" plot "$reference" -o "$scratch/out/run.png"
expect picture_folder_missing 5 '/nowhere' "$tribend" plot "$scratch/run.csv" -o /nowhere/run.png
expect record_folder_missing 5 '/nowhere' "$tribend" bend 20deg --record /nowhere/run.csv

# --- the command line
expect bend_without_unit 2 "'60' has no unit.*60deg" "$tribend" bend 60
expect toward_without_unit 2 "'30' has no unit" "$tribend" bend 60deg --toward 30
expect bend_with_pressure_unit 2 'mbar' "$tribend" bend 60mbar
expect bend_negative 2 'negative' "$tribend" bend -- -60deg
expect bend_missing 2 '60deg' "$tribend" bend
expect two_bends 2 'too much' "$tribend" bend 60deg 30deg
expect pressure_missing 2 'three pressures' "$tribend" pressure 40mbar 0mbar
expect pressure_negative 2 'below ambient' "$tribend" pressure -- -40mbar 0mbar 0mbar
expect pressure_without_unit 2 "'0' has no unit" "$tribend" pressure 40mbar 0 0mbar
expect duration_zero 2 'between 0 and' "$tribend" bend 60deg --for 0s
expect bus_unknown 7 "no bus 'can9'.*unix:PATH" "$tribend" status --bus can9
expect effect_unknown 2 'creep' "$tribend" bend 60deg --effect crep
expect effect_out_of_bounds 2 'amplitude' "$tribend" bend 60deg --effect creep:amplitude=9
expect drill_unknown 2 'overpressure' "$tribend" bend 60deg --drill fire@1s
expect drill_without_time 2 'tip-lost@2s' "$tribend" bend 60deg --drill tip-lost
expect seed_negative 2 'whole number' "$tribend" bend 60deg --seed -1
expect option_unknown 2 'speed' "$tribend" bend 60deg --speed 3
expect subcommand_unknown 2 "'dance'" "$tribend" dance
expect subcommand_missing 2 'Usage' "$tribend"
expect tables_subcommand_unknown 2 "'dance'" "$tables" dance
expect goal_without_unit 2 "'90' has no unit" "$tables" solve paper-semicircle --to 90
expect chamber_unknown 2 'chambers' "$tables" solve paper-semicircle --chamber 4
expect payload_without_unit 2 "'20' has no unit" "$tables" rod paper-semicircle 60mbar 0mbar 0mbar --payload 20
expect rod_pressure_missing 2 'three pressures' "$tables" rod paper-semicircle 60mbar
expect rod_overloaded 4 'load' "$tables" rod paper-semicircle 60mbar 0mbar 0mbar --payload 2kg --mount 180deg --csv "$scratch/out/rod.csv"
expect study_unknown 2 'wall, length' "$tables" study colour
expect run_without_columns 3 'p1_pa' "$tables" stiffness stiff-flop README.md
expect law_option_unknown 2 'law' "$tables" fit "$scratch/run.csv" --law hooke
expect tensile_file_wrong 3 'run.csv' "$tables" fit "$scratch/run.csv" --law yeoh

# --- faults end a run with their own code, and keep its log
for fault in overpressure sensor-range command-timeout table-corrupt; do
    name="drill_${fault//-/_}"
    expect "$name" 6 'FAULT.*(overpressure|out of range|timeout|corrupt)' "$tribend" bend 40deg --for 4s -q --drill "$fault@1s"
done
"$tribend" bend 40deg --for 4s -q --drill overpressure@1s --record "$scratch/fault.csv" >/dev/null 2>&1
echo "[ RUN      ] a_fault_keeps_the_log"
if grep -q ',FAULT,' "$scratch/fault.csv"; then
    echo "[       OK ] a_fault_keeps_the_log"
    passed=$((passed + 1))
else
    echo "[  FAILED  ] a_fault_keeps_the_log"
    failed=$((failed + 1))
fi

# --- recordings for a diagnosis
"$tribend" bend 40deg --for 3s -q --record "$scratch/good.csv" >/dev/null
log() { # NAME AWK_STATEMENT: the good log with its rows changed
    awk -F, "BEGIN { OFS = \",\" } /^#/ || /^time/ { print; next } { n++; $2; print }" "$scratch/good.csv" >"$scratch/$1.csv"
    echo "$scratch/$1.csv"
}
expect threads_with_a_tail 2 "4abc. is not a whole number from 1 to 1024" "$tribend" gap diagnose -q -T 4abc "$(log tail 1)"
expect log_in_bar 3 'looks like bar' "$tribend" gap diagnose -q "$(log bar 'for (i = 8; i <= 10; i++) $i = $i / 1e5')"
scale() { log "$1" "for (i = $2; i <= $3; i++) if (\$i != \"\") \$i = \$i * $4"; } # NAME FIRST_COLUMN LAST FACTOR
blank() { log "$1" "for (i = $2; i <= $3; i++) \$i = \"\"; for (i = $4; i <= $5; i++) \$i = \$i * $6"; }
expect log_in_kilopascal 3 'kpa.csv:[0-9]+: column p[123]_pa: .*looks like kPa, not Pa; multiply the columns by 1000' "$tribend" gap diagnose -q "$(scale kpa 8 10 1e-3)"
expect log_in_millibar 3 'looks like mbar' "$tribend" gap diagnose -q "$(scale mbar 8 10 1e-2)"
expect log_in_psi 3 'looks like psi' "$tribend" gap diagnose -q "$(scale psi 8 10 1.450377e-4)"
expect log_in_kilopascal_without_set_points 3 'looks like kPa .*psi .*mbar' "$tribend" gap diagnose -q "$(blank lonely 5 7 8 10 1e-3)"
expect log_with_set_points_in_kilopascal 3 'column p[123]_cmd_pa: .*looks like kPa' "$tribend" gap diagnose -q "$(scale cmdkpa 5 7 1e-3)"
expect log_with_supply_in_kilopascal 3 'column supply_pa: 40 .*looks like kPa' "$tribend" gap diagnose -q "$(scale supply 11 11 1e-3)"
expect log_in_pascal_times_1000 3 'p[123]_pa: .* beyond any soft module' "$tribend" gap diagnose -q "$(scale large 8 10 1000)"
expect log_absolute 3 'look absolute; subtract' "$tribend" gap diagnose -q "$(log absolute 'for (i = 8; i <= 10; i++) $i = $i + 101325')"
expect log_duty_in_percent 3 'percent.csv:[0-9]+: column valve[123]: .*looks like percent; divide' "$tribend" gap diagnose -q "$(scale percent 2 4 100)"
expect log_duty_in_counts 3 'column valve[123]: .*no duty' "$tribend" gap diagnose -q "$(scale counts 2 4 4095)"
expect log_time_in_milliseconds 3 'ms.csv:[0-9]+: column time_s: rows are .* looks like ms; divide' "$tribend" gap diagnose -q "$(scale ms 1 1 1000)"
expect log_time_in_microseconds 3 'looks like us; divide' "$tribend" gap diagnose -q "$(scale us 1 1 1e6)"
expect log_tip_in_micrometres 3 'looks like um' "$tribend" gap diagnose -q "$(scale um 12 14 1e6)"
expect log_turned_in_degrees 3 'degrees.csv:[0-9]+: column tip_qw: .*angles in degrees' "$tribend" gap diagnose -q "$(scale degrees 15 18 57.2958)"
expect log_bend_in_degrees 3 'column bend_cmd_rad: .*looks like degrees' "$tribend" gap diagnose -q "$(scale bend 22 22 57.2958)"
expect log_empty 3 'nothing.csv.*empty' "$tribend" gap diagnose -q "$(: >"$scratch/nothing.csv"; echo "$scratch/nothing.csv")"
expect log_header_only 3 'header.csv.*no rows' "$tribend" gap diagnose -q "$(grep -E '^#|^time' "$scratch/good.csv" >"$scratch/header.csv"; echo "$scratch/header.csv")"
expect log_in_millimetres 3 'looks like mm' "$tribend" gap diagnose -q "$(log mm 'for (i = 12; i <= 14; i++) if ($i != "") $i = $i * 1000')"
expect log_with_nan 3 'nan.csv:56: column p2_pa: .*leave the field empty' "$tribend" gap diagnose -q "$(log nan 'if (n == 50) $9 = "nan"')"
expect log_backwards 3 'backwards.csv:[0-9]+: .*time_s' "$tribend" gap diagnose -q "$(log backwards 'if (n == 50) $1 = 0')"
expect log_of_one_row 3 'one.csv' "$tribend" gap diagnose -q "$(log one 'if (n > 1) exit')"
expect log_of_another_module 3 'is of module other' "$tribend" gap diagnose -q "$(sed 's/^# module: .*/# module: other/' "$scratch/good.csv" >"$scratch/other.csv"; echo "$scratch/other.csv")"
expect effect_left_out_is_none 2 'no effect' "$tribend" gap diagnose -q --without nothing "$scratch/good.csv"

echo "[ RUN      ] log_without_movement_is_insufficient"
log still 'for (i = 5; i <= 10; i++) $i = 3000 + (n * 37) % 11; $2 = $3 = $4 = 0.3' >/dev/null
if "$tribend" gap diagnose "$scratch/still.csv" >"$scratch/stdout" 2>&1 && grep -q '^verdict *insufficient-data' "$scratch/stdout" &&
    grep -q 'pressures never move' "$scratch/stdout"; then
    echo "[       OK ] log_without_movement_is_insufficient"
    passed=$((passed + 1))
else
    cat "$scratch/stdout"
    echo "[  FAILED  ] log_without_movement_is_insufficient"
    failed=$((failed + 1))
fi
expect log_of_exchanged_chambers 3 'exchanged.csv:[0-9]+: the log.s chambers look exchanged: p1 and p2 .*swap columns p1_pa and p2_pa and repeat' "$tribend" gap diagnose -q "$(log exchanged 't = $8; $8 = $9; $9 = t')"

# --- calibrations: test_calibration.c has the messages; here, that each program gives them
cat >"$scratch/soft.yaml" <<'YAML'
module: paper-semicircle
stiffness_scale: { value: 0.9 }
supply_scale: { value: 1 }
effects: []
YAML
sed 's/paper-semicircle/paper-circle/' "$scratch/soft.yaml" >"$scratch/circle.yaml"
sed 's/0\.9/0.9kPa/' "$scratch/soft.yaml" >"$scratch/unit.yaml"
expect calibration_of_another_module 3 'circle.yaml:1: module: .*paper-circle, not of paper-semicircle' "$tribend" bend 10deg -q --calibration "$scratch/circle.yaml"
expect calibration_with_a_unit 3 "unit.yaml:2: value: '0.9kPa'" "$tribend" pressure 0kPa 0kPa 0kPa -q --controller-calibration "$scratch/unit.yaml"
expect calibration_missing 3 'none.yaml' "$tribend" status --calibration "$scratch/none.yaml"
expect table_of_another_calibration 3 'circle.yaml:1: module' "$tables" build paper-semicircle --calibration "$scratch/circle.yaml" -o "$scratch/out/table.tbt"
expect drill_on_a_calibrated_controller 6 'FAULT.*corrupt' "$tribend" bend 40deg --for 4s -q --drill table-corrupt@1s --controller-calibration "$scratch/soft.yaml"

# --- Ctrl-C: vents, keeps the log, 130
echo "[ RUN      ] interrupted_run"
"$tribend" bend 40deg --for 1440min --record "$scratch/interrupted.csv" >"$scratch/stdout" 2>&1 &
pid=$!
for _ in $(seq 600); do [ ! -s "$scratch/interrupted.csv.part" ] || break; sleep 0.1; done
kill -INT $pid
wait $pid
status=$?
if [ "$status" -eq 130 ] && grep -q '^vented' "$scratch/stdout" && "$tribend" plot "$scratch/interrupted.csv" -o "$scratch/interrupted.png" >/dev/null; then
    echo "[       OK ] interrupted_run"
    passed=$((passed + 1))
else
    tail -3 "$scratch/stdout"
    echo "[  FAILED  ] interrupted_run"
    failed=$((failed + 1))
fi
echo "[ RUN      ] interrupted_build"
"$tables" build paper-semicircle -o "$scratch/out/table.tbt" >"$scratch/stdout" 2>&1 &
pid=$!
sleep 1
kill -INT $pid
wait $pid
status=$?
if [ "$status" -eq 130 ] && [ -z "$(ls -A "$scratch/out")" ]; then
    echo "[       OK ] interrupted_build"
    passed=$((passed + 1))
else
    echo "exit $status"; tail -3 "$scratch/stdout"; ls -A "$scratch/out"
    echo "[  FAILED  ] interrupted_build"
    failed=$((failed + 1))
fi
echo "[  PASSED  ] $passed test(s)."
[ "$failed" -eq 0 ] && [ "$passed" -ge 60 ]

#!/bin/bash
# The DBC file and the message page are what messages.def says; a parser that is not ours agrees with `tribend decode` on
# random frames; decode says what it left out.
build=${TRIBEND_BUILD:-build}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
. tests/support/check.sh
shown="$scratch/*.txt"
"$build/tribend" dbc | cmp -s - docs/tribend.dbc
check the_dbc_is_made_from_the_table $?
"$build/tribend" dbc --page | cmp -s - docs/messages.md
check the_page_is_made_from_the_table $?
/usr/bin/python3 -W ignore tests/host/dbc_independent.py docs/tribend.dbc "$build/tribend" 1000 >"$scratch/dbc.txt" 2>&1
check an_independent_parser_decodes_the_same $?
"$build/tribend" dbc --node 3 -o "$scratch/three.dbc" && grep -q "^BO_ $((0x113)) PRESSURES: 8 Board" "$scratch/three.dbc"
check another_node_has_its_own_identifiers $?
"$build/tribend" dbc -o "$scratch/no/such/folder.dbc" 2>"$scratch/error.txt"
[ $? -eq 5 ] && grep -q 'no/such/folder' "$scratch/error.txt"
check an_output_that_cannot_be_written_is_named $?
for node in 0 16 x; do "$build/tribend" dbc --node $node >/dev/null 2>&1; [ $? -eq 2 ] || echo "$node" >>"$scratch/nodes.txt"; done
[ ! -e "$scratch/nodes.txt" ]
check nodes_are_1_to_15 $?
# the page's own commands, as they are
grep -o '051#$(printf %02x $s)01[0-9A-F]*' docs/messages.md | sed 's/\$(printf %02x $s)/07/' | "$build/tribend" decode >"$scratch/bend.txt"
grep -q 'BEND_COMMAND to node 1: sequence 7, protocol 1, bend 1.0472 rad, direction 0.5236 rad' "$scratch/bend.txt"
check the_pages_cansend_bends_as_it_says $?
printf '(1.000001) can0 111#F401F401F4010000\n(1.000002) can0 123#00\n(1.000003) can0 7FF#00\n(1.000004) can0 111#R\n' \
    | "$build/tribend" decode -l >"$scratch/out.txt" 2>"$scratch/error.txt"
[ $? -eq 0 ] && [ "$(cat "$scratch/out.txt")" = "(1.000001) can0 PRESSURES from node 1: pressure_1 1000 Pa, pressure_2 1000 Pa, pressure_3 1000 Pa, step 0" ] \
    && grep -q '1 frames decoded, 2 of others, 1 of another length' "$scratch/error.txt"
check what_is_left_out_is_said $?
printf '111#F401F401F4010000\nrubbish\n' | "$build/tribend" decode >/dev/null 2>"$scratch/error.txt"
[ $? -eq 3 ] && grep -q 'line 2' "$scratch/error.txt"
check a_line_that_is_no_frame_is_named $?
printf '  can0  111   [8]  01 02 03 04 05 06 07 08\n' | "$build/tribend" decode -l >/dev/null 2>"$scratch/error.txt"
[ $? -eq 3 ]
check logs_only_where_logs_are_asked_for $?
printf '111#0000000000000000\n112#0000000000000000\n010#\n' | "$build/tribend" decode --node 2 2>/dev/null >"$scratch/out.txt"
[ "$(cut -d: -f1 "$scratch/out.txt" | tr '\n' ,)" = "PRESSURES from node 2,VENT to node 0," ]
check one_boards_frames_are_picked_out $?
"$build/tribend" decode "$scratch/none" 2>"$scratch/error.txt"
[ $? -eq 3 ] && grep -q 'No such file' "$scratch/error.txt"
check a_missing_file_is_named $?
check_end

#!/bin/bash
# docs/faults.md is what faults.def says, and the commands that these pages show exist.
build=${TRIBEND_BUILD:-build}
. tests/support/check.sh
"$build/tests/docs/faults_page" | cmp -s - docs/faults.md
check the_page_is_made_from_the_table $?
rows=$(grep -cE '^(FAULT|WARNING)\(' firmware/safety/faults.def)
[ "$(grep -c '^### ' docs/faults.md)" = "$rows" ] && [ "$rows" -ge 30 ]
check every_row_has_its_section $?
# a section starts with what the operator sees: a sentence, before any list
awk '/^### /{want=1; next} want && NF {if ($0 !~ /^[A-Z].*\.$/) bad=1; want=0} END {exit bad}' docs/faults.md
check sections_start_with_what_is_seen $?
make help | grep -q '^ *make campaign'
check the_campaign_has_its_target $?
"$build/tests/campaign/campaign" --fault 'no such thing' 2>&1 | grep -q "no fault has 'no such thing'"
check an_unknown_fault_is_named $?
"$build/tests/campaign/campaign" -n none >/dev/null 2>&1
[ $? -eq 2 ]
check a_bad_number_is_refused $?
check_end

#!/bin/bash
# The firmware's files, its bounds, and the tool that bounds its stack: each must fail when what it holds is exceeded.
. tests/support/check.sh
build=${TRIBEND_BUILD:?}
elf=$build/firmware/tribend.elf
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
shown=$work/said

report() { tests/tools/firmware_report "$elf" >"$work/said" 2>&1; }
report && grep -q 'flash, firmware and table' "$work/said"
check flash_ram_and_stack_are_within_their_bounds $?
FLASH_BOUND=200000 report
[ $? -eq 1 ] && grep -q 'flash.*OVER' "$work/said"
check too_much_flash_fails $?
RAM_BOUND=8000 report
[ $? -eq 1 ] && grep -q 'RAM.*OVER' "$work/said"
check too_much_ram_fails $?

[ "$(stat -c %s "${elf%.elf}.bin")" -le 262144 ] && arm-none-eabi-objcopy -O binary -j .text "$elf" "$work/text" &&
    cmp -s -n "$(stat -c %s "$work/text")" "$work/text" "${elf%.elf}.bin"
check the_binary_starts_with_the_code_and_fits_a_bank $?
dd if="${elf%.elf}.bin" bs=4096 skip=18 status=none | head -c 182276 | cmp -s - tables/paper-semicircle.tbt
check the_reference_table_lies_in_slot_a $?
[ -s "${elf%.elf}.map" ]
check the_map_is_there $?
! arm-none-eabi-nm "$elf" | grep -qE ' (malloc|free|_sbrk|printf)$'
check nothing_allocates_or_prints $?

# --- the stack tool, on small programs whose answer is known
cat >"$work/indirect" <<'END'
@table: leaf
case.c: @table
END
judge() { # code on stdin
    cat - >"$work/case.c"
    rm -rf "$work/objects" && mkdir "$work/objects"
    cat >>"$work/case.c" <<'END'
void faults_enter(void) {}
END
    (cd "$work" && arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb -O1 -fstack-usage -fno-inline -fno-optimize-sibling-calls \
        -c case.c -o objects/case.o) || return 9
    arm-none-eabi-ld -e handler_reset "$work/objects/case.o" -o "$work/case.elf" || return 9
    tests/tools/stack_usage "$work/case.elf" "$work/objects" "$work/indirect" >"$work/said" 2>&1
}
use='void use(volatile char *p) { *p = 1; }'
judge <<END
$use
int leaf(int x) { volatile char room[100]; use(room); return x; }
void handler_reset(void) { volatile char room[40]; use(room); leaf(1); }
END
sum=$(awk -F'\t' '{ n = $1; sub(/.*:/, "", n); size[n] = $2 } END { print size["handler_reset"] + size["leaf"] + size["use"] }' "$work/objects/case.su")
[ "$sum" -gt 140 ] && grep -q "^main $sum$" "$work/said"
check calls_add_up $?
judge <<END
$use
void handler_tick(void) { volatile char room[64]; use(room); }
void handler_reset(void) { volatile char room[40]; use(room); }
END
sum=$(awk -F'\t' '{ n = $1; sub(/.*:/, "", n); size[n] = $2 } END { print size["handler_reset"] + size["handler_tick"] + 2 * size["use"] + 112 }' "$work/objects/case.su")
grep -q "^main $sum$" "$work/said"
check an_interrupt_comes_on_top_with_its_frame $?
judge <<END
$use
int odd(int n); int even(int n) { return n == 0 ? 1 : odd(n - 1) + 1; } int odd(int n) { return n == 0 ? 0 : even(n - 1) + 1; }
void handler_reset(void) { even(9); }
END
[ $? -ne 0 ] && grep -q 'recursion through' "$work/said"
check recursion_is_refused $?
judge <<END
$use
void handler_reset(void) { volatile int n = 9; char room[n]; use(room); }
END
[ $? -ne 0 ] && grep -q 'has no bound' "$work/said"
check an_array_of_variable_length_is_refused $?
judge <<END
$use
int leaf(int x) { volatile char room[100]; use(room); return x; }
int (*volatile pointer)(int) = leaf;
int listed(void) { return pointer(1) + 1; }
void handler_reset(void) { listed(); }
END
sum=$(awk -F'\t' '{ n = $1; sub(/.*:/, "", n); size[n] = $2 } END { print size["handler_reset"] + size["listed"] + size["leaf"] + size["use"] }' "$work/objects/case.su")
grep -q "^main $sum$" "$work/said"
check a_listed_call_through_a_pointer_counts $?
echo "other.c: leaf" >"$work/indirect"
judge <<END
int leaf(int x) { return x; }
int (*volatile pointer)(int) = leaf;
int stranger(void) { return pointer(1) + 1; }
void handler_reset(void) { stranger(); }
END
[ $? -ne 0 ] && grep -q 'stranger (.*) calls through a pointer' "$work/said"
check an_unlisted_call_through_a_pointer_is_refused $?
check_end

#!/bin/bash
# `make flash` with stand-ins for the tools: which is taken, what it is told, and what is said where there is none or no board.
. tests/support/check.sh
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
shown=$work/said
mkdir "$work/tools"
echo elf >"$work/image.elf"
echo bin >"$work/image.bin"
# what the script itself needs, and none of the flashing tools of this machine
for tool in bash dirname cat; do ln -s "$(command -v $tool)" "$work/tools/$tool"; done
stand_in() { # name, exit code
    printf '#!/bin/bash\necho "$0 $*" >>%s/told\nexit %s\n' "$work" "$2" >"$work/tools/$1"
    chmod +x "$work/tools/$1"
}
flash() {
    : >"$work/told"
    PATH=$work/tools tests/tools/flash "$@" >"$work/said" 2>&1
}

flash "$work/image"
[ $? -eq 4 ] && grep -q 'none of openocd' "$work/said" && grep -q 'apt-get install' "$work/said"
check without_a_tool_the_message_says_what_to_install $?

flash "$work/absent"
[ $? -eq 3 ] && grep -q "absent.elf; run 'make firmware'" "$work/said"
check without_an_image_the_message_names_it $?

stand_in dfu-util 0
flash "$work/image" && grep -q 'dfu-util.*-s 0x08000000:leave -D .*image.bin' "$work/told" && grep -q 'brown-out' "$work/said"
check dfu_util_writes_the_binary_and_says_what_it_leaves $?

stand_in st-flash 0
flash "$work/image" && grep -q 'st-flash --reset write .*image.bin 0x08000000' "$work/told" && ! grep -q dfu "$work/told"
check st_flash_goes_before_dfu_util $?

stand_in openocd 0
flash "$work/image" && grep -q 'write_image erase .*image.elf' "$work/told" && ! grep -q st-flash "$work/told"
check openocd_goes_first $?
grep -q 'verify_image' "$work/told" && grep -q 'option_write 0 0x20 0x400 0x700' "$work/told"
check openocd_verifies_and_sets_the_brown_out_level $?

TOOL=st-flash flash "$work/image" && grep -q st-flash "$work/told" && ! grep -q openocd "$work/told"
check tool_picks_one $?

TOOL=jlink flash "$work/image"
[ $? -eq 2 ] && grep -q 'TOOL=jlink is none of' "$work/said"
check an_unknown_tool_is_refused $?

for tool in openocd st-flash dfu-util; do
    stand_in $tool 1
    TOOL=$tool flash "$work/image"
    [ $? -eq 4 ] && grep -q "$tool found no board" "$work/said" && grep -q 'lsusb -d 0483:' "$work/said" && ! grep -q 'flash: done' "$work/said"
    check "no_board_is_said_with_${tool//-/_}" $?
done
check_end

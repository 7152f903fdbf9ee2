#!/bin/bash
# docs/board.md: its commands as written and in order; those that last go on in the background.
build=${TRIBEND_BUILD:-build}
. tests/support/check.sh
scratch=$(mktemp -d)
shown=$scratch/said
started=()
trap '[ ${#started[@]} -eq 0 ] || kill "${started[@]}" 2>/dev/null; wait 2>/dev/null; rm -rf "$scratch"' EXIT
commands=0
while read -r command; do
    commands=$((commands + 1))
    name=$(sed 's#build/##; s#tribend ##; s# --.*##; s#[^a-z0-9]#_#g' <<<"$command" | cut -c1-40)
    command=${command//unix:build\/bus/unix:$scratch\/bus}
    # what it writes
    command=$(sed -E "s#build/(board[a-z-]*\.[a-z]+|bend_over_lcm)#$scratch/\1#g; s#(^| |-I)build/#\1$build/#g" <<<"$command")
    [ "$build" = build ] || command=${command/tribend board/tribend board --elf $build\/firmware\/tribend.elf}
    case $command in
    *" board "* | *" bridge "*)
        $command >"$scratch/said.$commands" 2>&1 &
        started+=($!)
        until_true grep -qE 'state: SAFE|is heard' "$scratch/said.$commands"
        ;;
    *) timeout 300 $command >"$scratch/said" 2>&1 </dev/null ;;
    esac
    check "$name" $?
done < <(sed -n 's/^    //p' docs/board.md)
grep -qE 'bend (29|30)\.' "$scratch/said"
check bend_over_lcm_is_what_was_asked_for $?
[ "$commands" -eq 13 ]
check every_command_was_run $?
check_end

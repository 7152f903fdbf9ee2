#!/bin/bash
# Man pages and completion against what the programs themselves say: each subcommand, each option of its --help, an example
# whose options exist, every exit code; and mandoc finds nothing wrong with any page.
build=${TRIBEND_BUILD:-build}
manual=$build/manual
. tests/support/check.sh
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
shown="$scratch/said"

# subcommands COMMAND...: that it lists
subcommands() { "$@" --help 2>/dev/null | sed -n '/^Usage: .* SUBCOMMAND/,$s/^  \([a-z-]*\) .*/\1/p'; }
# options of a --help on standard input, long ones, one a line
long_options() { grep -oE '(^|[ ,])--[a-z][a-z-]*' | sed 's/.*--/--/' | sort -u; }
# completes PROGRAM WORDS...: what completion offers for the last word
completes() {
    local program=$1
    COMP_WORDS=("$@")
    COMP_CWORD=$(($# - 1))
    COMPREPLY=()
    "_${program//-/_}"
    printf '%s\n' "${COMPREPLY[@]}"
}

# whole COMMAND...: its page and completion have every option of its help, and its help an example that could be run
whole() {
    local page=$manual/$(basename "$1")
    local program=${page##*/} words=("${@:2}") name="$*"
    [ $# -eq 1 ] || page=$page-$(IFS=-; echo "${words[*]}")
    name=${name#"$build/"}
    "$@" --help >"$scratch/help" 2>&1
    : >"$scratch/said"
    man -l -E UTF-8 "$page.1" 2>>"$scratch/said" | col -b >"$scratch/page"
    completes "$program" "${words[@]}" '' >"$scratch/words"
    for option in $(grep -E '^ +-' "$scratch/help" | long_options | grep -vE -- '--(usage|version)$'); do
        grep -qE -- "(^|[ ,])$option([=, ]|\$)" "$scratch/page" || echo "$page.1 lacks $option"
        grep -qx -- "$option" "$scratch/words" || echo "completion of $name lacks $option"
    done >>"$scratch/said"
    for option in $(sed -n 's/^\(Example: \|  \)\(tribend.*\)/\2/p' "$scratch/help" | long_options); do
        grep -E '^ +-' "$scratch/help" | long_options | grep -qx -- "$option" || echo "the example of $name has $option, which is none"
    done >>"$scratch/said"
    grep -qE "^(Example: |  )$name" "$scratch/help" || echo "$name --help has no example" >>"$scratch/said"
    [ ! -s "$scratch/said" ]
    local result=$? # before a substitution has its own
    check "whole_$(tr ' -' '__' <<<"$name")" $result
}

# walk COMMAND...: all below it
walk() {
    local word result
    for word in $(subcommands "$@"); do
        completes "$(basename "$1")" "${@:2}" '' | grep -qx -- "$word"
        result=$?
        check "completion_has_$(tr ' -' '__' <<<"$(basename "$1") ${*:2}")_$word" $result
        if [ -n "$(subcommands "$@" "$word")" ]; then walk "$@" "$word"; else whole "$@" "$word"; fi
    done
}

for program in tribend tribend-tables; do
    # shellcheck disable=SC1090
    . "$manual/$program.bash"
    walk "$build/$program"
done
[ "$passed" -ge 40 ]
check subcommands_were_found_at_all $?

completes tribend bend --effect val | sort | tr '\n' ' ' >"$scratch/said"
[ "$(cat "$scratch/said")" = "valve_dead_band valve_dead_time valve_sluggish " ]
check effects_are_completed $?
completes tribend bend --bus s | grep -qx sim
check buses_are_completed $?

mandoc -Tlint -Wwarning "$manual"/*.1 >"$scratch/said" 2>&1
check mandoc_finds_no_fault $?
man -l --warnings=all -E UTF-8 "$manual"/*.1 2>"$scratch/said" >/dev/null && [ ! -s "$scratch/said" ]
check groff_finds_no_fault $?

man -l -E UTF-8 "$manual/tribend.1" 2>/dev/null | col -b >"$scratch/said"
sed -n 's/^ *X([A-Z_]*, \([0-9]*\), "\([^"]*\)").*/\1 \2/p' model/program/program.h >"$scratch/exits"
[ "$(wc -l <"$scratch/exits")" -ge 8 ] && while read -r code text; do
    grep -A1 -E "^ +$code( |\$)" "$scratch/said" | tr -s ' \n' ' ' | grep -qF "${text:0:40}" || { echo "no exit code $code"; exit 1; }
done <"$scratch/exits"
check page_has_every_exit_code $?
[ "$("$build/tribend" --version)" = "tribend $(sed -n 's/.*TRIBEND_VERSION "\(.*\)"/\1/p' model/program/version.h)" ]
check version_is_said $?
check_end

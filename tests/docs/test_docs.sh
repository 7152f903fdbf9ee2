#!/bin/bash
# The documentation as a whole, which `make docs` runs too: links and files that it names exist, every subcommand is shown, every
# public header says what its functions do, drawings can be drawn, and what docs/units-and-frames.md shows runs.
build=${TRIBEND_BUILD:-build}
. tests/support/check.sh
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
shown="$scratch/said"
pages=(README.md docs/*.md tables/README.md tables/*/README.md)

# targets of links, from the page's folder; files that are named with their folder, from the top
for page in "${pages[@]}"; do
    grep -oE '\]\([^)# ]+' "$page" | sed 's/](//' | grep -vE '^https?:' | while read -r target; do
        [ -e "$(dirname "$page")/$target" ] || echo "$page links to $target, which is not there"
    done
    grep -oE '\]\(#[^)]+' "$page" | sed 's/](#//' | while read -r target; do
        grep -E '^#+ ' "$page" | tr 'A-Z ' 'a-z-' | tr -cd 'a-z0-9\n-' | sed 's/^-*//' | grep -qx -- "$target" || echo "$page links to its #$target, which is not there"
    done
    grep -oE '(^|[ `(])(docs|tables|tests|host|hal|model|firmware)/[A-Za-z0-9_./*{},-]*[A-Za-z0-9_/*]' "$page" | sed 's/^[ `(]*//' | while read -r target; do
        [[ $target == *NAME* ]] || compgen -G "$target" >/dev/null || echo "$page names $target, which is not there"
    done
    grep -oE '\]\(http[^)]*' "$page" | grep -vE '^\]\(https?://[a-z0-9.-]+\.[a-z]+(/[^ ]*)?$' | sed "s|^|$page has a link that is none: |"
done >"$scratch/said"
[ ! -s "$scratch/said" ]
check links_and_named_files_are_there $?

for page in docs/*.md; do
    for other in "${pages[@]}"; do [ "$other" = "$page" ] || cat "$other"; done | grep -qF "$page" || echo "no page leads to $page"
done >"$scratch/said"
[ ! -s "$scratch/said" ]
check every_page_can_be_reached $?

for program in tribend tribend-tables; do
    for word in $("$build/$program" --help | sed -n 's/^  \([a-z-]*\) .*/\1/p'); do
        grep -qE "$program $word( |\`|\$)" "${pages[@]}" || echo "no page shows $program $word"
    done
done >"$scratch/said"
[ ! -s "$scratch/said" ]
check every_subcommand_is_shown $?

tests/tools/docs_check firmware/*.h firmware/*/*.h hal/*.h hal/*/*.h model/*/*.h host/*/*.h >"$scratch/said"
check every_public_header_says_what_it_does $?

for drawing in docs/*.svg; do
    rsvg-convert "$drawing" -o "$scratch/drawing.png" 2>>"$scratch/said" && [ -s "$scratch/drawing.png" ] || echo "$drawing" >>"$scratch/said"
done
[ ! -s "$scratch/said" ]
check drawings_can_be_drawn $?

# units: the page's table is the program's
grep -oE '\{UNITS_[A-Z]*, "[A-Za-z]*"' model/units/units.c | sed 's/.*"\(.*\)"/\1/' |
    while read -r unit; do grep -q "\`$unit\`" docs/units-and-frames.md || echo "docs/units-and-frames.md lacks the unit $unit"; done >"$scratch/said"
[ ! -s "$scratch/said" ]
check units_page_has_every_unit $?

while read -r command; do
    # shellcheck disable=SC2086
    ${command//build\//$build/} </dev/null >"$scratch/said" 2>&1
    check "$command" $?
done < <(grep -E '^    build/' docs/units-and-frames.md | sed 's/^ *//')
check_end

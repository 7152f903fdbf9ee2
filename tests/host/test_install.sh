#!/bin/bash
# make install and uninstall: staged, run from elsewhere, found by pkg-config, man and systemd; nothing left behind.
build=${TRIBEND_BUILD:-build}
. tests/support/check.sh
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
shown="$scratch/said"
root=$scratch/stage/opt/lab
version=$(sed -n 's/.*TRIBEND_VERSION "\(.*\)"/\1/p' model/program/version.h)

make_in_stage() { make --no-print-directory BUILD="$build" DESTDIR="$scratch/stage" PREFIX=/opt/lab "$@" >"$scratch/said" 2>&1; }
# elsewhere COMMAND...: in an empty folder, without what points at this tree
elsewhere() { (cd "$scratch/empty" && env -u TRIBEND_TABLE -u TRIBEND_BUILD "$@" >"$scratch/said" 2>&1); }
mkdir "$scratch/empty"

make_in_stage install
check installs $?
elsewhere "$root/bin/tribend" bend 30deg --for 2s -q --record run.csv && [ -s "$scratch/empty/run.csv" ]
check tribend_finds_its_table $?
elsewhere "$root/bin/tribend-tables" material ecoflex-0030-measured
check tribend_tables_finds_its_materials $?
elsewhere "$root/bin/tribend" board --for 0.05s && grep -q '^step' "$scratch/said"
check the_board_finds_its_firmware $?
printf 't,p\n0,1\n' >"$scratch/empty/other.csv"
elsewhere "$root/bin/tribend" import other.csv --mapping kcl_stiff_flop -o out.csv
grep -q 'share/tribend/tables/mappings/kcl_stiff_flop.yaml\|other.csv' "$scratch/said" && ! grep -q 'kcl_stiff_flop.*No such file' "$scratch/said"
check mappings_are_found $?
elsewhere "$root/bin/tribend" view --for 0.2s --port 0
check view_has_its_page_in_it $?

export PKG_CONFIG_PATH=$root/share/pkgconfig
[ "$(pkg-config --modversion tribend)" = "$version" ]
check pkg_config_says_the_version $?
[ "$(pkg-config --variable=datadir tribend)" = /opt/lab/share/tribend ] &&
    [ -s "$scratch/stage$(pkg-config --variable=tablesdir tribend)/paper-semicircle.tbt" ]
check pkg_config_says_where_the_data_is $?
pkg-config --validate tribend >"$scratch/said" 2>&1
check pkg_config_file_is_sound $?

elsewhere env MANPATH="$root/share/man" man -w tribend-gap-diagnose
check man_finds_the_pages $?
bash -c ". '$root/share/bash-completion/completions/tribend' && complete -p tribend" >"$scratch/said" 2>&1
check completion_loads_by_its_name $?
unit=$root/lib/systemd/system/tribend-bridge@.service
grep -q '^ExecStart=/opt/lab/bin/tribend bridge --bus %I' "$unit"
check the_unit_runs_the_installed_program $?
if command -v systemd-analyze >/dev/null; then
    mkdir -p "$scratch/units" # where the program is before it is moved to its place
    sed "s|/opt/lab|$root|" "$unit" >"$scratch/units/tribend-bridge@can0.service"
    systemd-analyze verify --man=no "$scratch/units/tribend-bridge@can0.service" >"$scratch/said" 2>&1 && [ ! -s "$scratch/said" ]
    check systemd_finds_no_fault_in_the_unit $?
fi

make_in_stage uninstall
check uninstalls $?
[ -z "$(find "$scratch/stage" -type f)" ] && [ ! -e "$root/share/tribend" ] && [ ! -e "$root/share/doc/tribend" ]
check nothing_is_left $?
! make_in_stage uninstall && grep -q 'nothing is installed below' "$scratch/said"
check a_second_uninstall_says_so $?
! make --no-print-directory BUILD="$build" DESTDIR="$scratch/stage" PREFIX=relative install >"$scratch/said" 2>&1 &&
    grep -q 'must begin with /' "$scratch/said"
check a_relative_prefix_is_refused $?
check_end

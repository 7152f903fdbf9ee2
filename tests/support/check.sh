# What the shell tests share: a named check in the runner's words, and how many there were. Sourced, not run.
# `shown`: a file, or a pattern of files, that is printed when a check fails.
passed=0 failed=0 shown=
check() { # name, condition's status
    echo "[ RUN      ] $1"
    if [ "$2" -eq 0 ]; then
        echo "[       OK ] $1"
        passed=$((passed + 1))
    else
        # shellcheck disable=SC2086
        [ -z "$shown" ] || cat $shown
        echo "[  FAILED  ] $1"
        failed=$((failed + 1))
    fi
}
# until_true COMMAND..: true as soon as the command succeeds; the bound is for what hangs, nothing is timed by it
until_true() {
    local end=$((SECONDS + 60))
    until "$@"; do
        [ "$SECONDS" -lt "$end" ] || return 1
        short_pause
    done
}
short_pause() { sleep 0.05; }
# The closing line; false where a check failed.
check_end() {
    echo "[  PASSED  ] $passed test(s)."
    [ "$failed" -eq 0 ]
}

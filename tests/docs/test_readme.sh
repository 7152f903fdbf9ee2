#!/bin/bash
# Every command that the README shows below "build/" is run as it stands, in order, and must succeed.
# Prints cmocka's closing lines, so that the runner counts each command as a test.
build=${TRIBEND_BUILD:-build}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# A tensile test in the database's format, drawn from a known Yeoh law: the README's TENSILE.csv.
awk 'BEGIN {
    print "PARAMETER;INFO;URL;;\nSpecimen Length (mm);33;;;\n"
    print "Time (s);True Strain;True Stress (MPa);Engineering Strain;Engineering Stress (MPa)"
    for (i = 1; i <= 320; i++) {
        e = i / 100; l = 1 + e; x = l * l + 2 / l - 3
        s = 2 * (l - 1 / (l * l)) * (8000 + 2 * 100 * x + 3 * 1 * x * x) / 1e6
        printf "%.2f;%.6f;%.8f;%.4f;%.8f\n", i / 22.7, log(l), s * l, e, s
    }
}' >"$scratch/TENSILE.csv"

passed=0 failed=0
while read -r command; do
    command=${command//build\//$build/}
    [ "$(id -u)" = 0 ] && command=${command/mpirun/mpirun --allow-run-as-root --oversubscribe}
    command=${command/TENSILE.csv/$scratch/TENSILE.csv}
    command=${command/my-material.yaml/$scratch/my-material.yaml}
    echo "[ RUN      ] $command"
    if $command </dev/null >"$scratch/out" 2>&1; then
        echo "[       OK ] $command"
        passed=$((passed + 1))
    else
        cat "$scratch/out"
        echo "[  FAILED  ] readme_command"
        echo "           $command"
        failed=$((failed + 1))
    fi
done < <(grep -E '^    (mpirun .*)?build/' README.md | sed 's/^ *//')
echo "[  PASSED  ] $passed test(s)."
[ "$failed" -eq 0 ] && [ "$passed" -eq "$(grep -cE '^    (mpirun .*)?build/' README.md)" ]

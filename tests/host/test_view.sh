#!/bin/bash
# The live view: what a browser shows and what it may do (view/view_browser.mjs in headless Chromium), what the server refuses
# and why, and that Ctrl-C vents.
build=${TRIBEND_BUILD:-build}
tribend=$build/tribend
. tests/support/check.sh
scratch=$(mktemp -d)
server=
trap '[ -z "$server" ] || kill "$server" 2>/dev/null; rm -rf "$scratch"' EXIT
shown="$scratch/said"

# serve OPTIONS...: starts it; $address and $token
serve() {
    "$tribend" view --port 0 "$@" >"$scratch/said" 2>&1 &
    server=$!
    has_said_where() { address=$(sed -n 's/^view  *//p' "$scratch/said") && [ -n "$address" ] || ! kill -0 $server 2>/dev/null; }
    until_true has_said_where
    [ -n "$address" ] || { check view_starts 1; exit 1; }
    token=${address##*token=} address=${address%%#*}
    [ "$token" != "$address" ] || token=$(curl -s "${address}session" | sed 's/.*:"//; s/".*//')
}
stop() {
    kill -INT $server
    wait $server
    code=$?
    server=
}
# refuses NAME STATUS PATTERN curl's arguments...: with that status, and a reason that matches
refuses() {
    local name=$1 status=$2 pattern=$3
    shift 3
    curl -sS -m 120 -o "$scratch/body" -w '%{http_code}' "$@" >"$scratch/status"
    [ "$(cat "$scratch/status")" = "$status" ] && grep -qE "\"error\":\".*$pattern" "$scratch/body"
    local result=$?
    [ $result = 0 ] || echo "$(cat "$scratch/status") $(cat "$scratch/body")"
    check "$name" $result
}

serve --lease 10s --for 60min
post=(-H "Authorization: Bearer $token" -d '{"page":"a"}')
command=(-H "Authorization: Bearer $token" "${address}command" -d)
refuses no_token_no_data 401 'token is missing or wrong' "${address}module"
refuses wrong_token 401 'token is missing or wrong' "${address}events?page=a&token=${token}0"
refuses post_without_header_even_with_the_token_in_the_url 401 'Authorization' "${address}vent?token=$token" -d '{"page":"a"}'
refuses another_origin 403 "another site" -H 'Origin: http://example.org' "${post[@]}" "${address}vent"
refuses another_name_for_this_machine 403 '127.0.0.1 or localhost' -H 'Host: rebound.example.org' "${address}session"
refuses unknown_path 404 'nothing here' "${address}../etc/passwd" --path-as-is
refuses unknown_post 404 'nothing to post' "${post[@]}" "${address}fire"
refuses unknown_method 405 'GET and POST' -X DELETE "${address}"
refuses no_json 400 'not a JSON object' -H "Authorization: Bearer $token" -d 'page=a' "${address}arm"
refuses no_page 400 'page.*1 to 39' -H "Authorization: Bearer $token" -d '{"page":""}' "${address}arm"
refuses key_too_many 400 '1 keys are expected' -H "Authorization: Bearer $token" -d '{"page":"a","all":1}' "${address}arm"
refuses body_too_large 413 '1024 bytes' -H "Authorization: Bearer $token" -d "{\"page\":\"$(head -c 2000 /dev/zero | tr '\0' a)\"}" "${address}arm"
refuses bend_out_of_bounds 400 'bend_deg.*from 0 to 110' "${command[@]}" '{"page":"a","bend_deg":111,"direction_deg":0,"co_contraction_kpa":0}'
refuses bend_that_is_no_number 400 'bend_deg' "${command[@]}" '{"page":"a","bend_deg":"60","direction_deg":0,"co_contraction_kpa":0}'
refuses number_left_out 400 'direction_deg' "${command[@]}" '{"page":"a","bend_deg":10}'
refuses command_without_arm 409 'not armed' "${command[@]}" '{"page":"a","bend_deg":10,"direction_deg":0,"co_contraction_kpa":0}'
# a page whose stream ends loses the arm at once, not when its lease runs out
curl -sN -m 600 "${address}events?page=watcher&token=$token" >"$scratch/watched" 2>/dev/null &
watcher=$!
curl -sN -m 600 "${address}events?page=closer&token=$token" >"$scratch/closer" 2>/dev/null &
closer=$!
until_true test -s "$scratch/closer"
until_true test -s "$scratch/watched"
curl -s -H "Authorization: Bearer $token" -d '{"page":"closer"}' "${address}arm" >/dev/null
kill $closer
says_why() { grep -q 'was closed\|fell silent' "$scratch/watched"; }
until_true says_why
grep -q 'was closed' "$scratch/watched" && ! grep -q 'fell silent' "$scratch/watched"
check closed_stream_takes_the_arm_away $?
kill $watcher
for page in 1 2 3 4 5 6 7 8; do
    # 503 is tried again: the server notices a closed stream when it next writes
    curl -sN -m 600 --retry 120 --retry-delay 1 "${address}events?page=$page&token=$token" >"$scratch/stream$page" 2>/dev/null &
    streams="$streams $!"
done
for page in 1 2 3 4 5 6 7 8; do
    until_true grep -q data: "$scratch/stream$page"
done
refuses ninth_page 503 'too many pages' "${address}events?page=9&token=$token"
# shellcheck disable=SC2086
kill $streams 2>/dev/null
cp tests/host/view/package.json tests/host/view/package-lock.json "$scratch/"
tests/tools/npm_packages "$scratch"
while read -r verdict name; do
    [ "$verdict" = failed ] && echo "$name"
    case $verdict in ok | failed) check "${name%%:*}" "$([ "$verdict" = ok ]; echo $?)" ;; *) echo "$verdict $name" ;; esac
done < <(node tests/host/view/view_browser.mjs "$scratch" "$address" "$build/view.png" 2>&1 || echo "failed browser")
[ -s "$build/view.png" ]
check screenshot_is_taken $?
stop
[ $code = 130 ] && grep -q '^vented$' "$scratch/said"
check interrupted_it_vents $?

# beyond this machine
serve --listen 0.0.0.0 --for 60min
refuses from_elsewhere_no_token_is_given_away 403 'token' "${address}session"
curl -s -H "Authorization: Bearer $token" "${address}module" | grep -q '"module":"paper-semicircle"'
check from_elsewhere_the_printed_token_opens $?
stop
echo 0123456789abcdefghij >"$scratch/token"
chmod 644 "$scratch/token"
"$tribend" view --token-file "$scratch/token" >"$scratch/said" 2>&1
[ $? = 3 ] && grep -q 'chmod 600' "$scratch/said"
check token_file_that_others_may_read $?
chmod 600 "$scratch/token"
serve --token-file "$scratch/token" --for 60min --record "$scratch/run.csv"
curl -s -H "Authorization: Bearer 0123456789abcdefghij" "${address}module" | grep -q '"bus":"sim"'
check token_file_opens $?
has_rows() { [ "$(wc -l <"$scratch/run.csv.part")" -gt 1000 ]; } # a second of motion to draw
until_true has_rows
stop
"$tribend" plot "$scratch/run.csv" -o "$scratch/run.png" >/dev/null 2>&1
check recorded_run_can_be_drawn $?
"$tribend" view --listen nowhere >"$scratch/said" 2>&1
[ $? = 5 ] && grep -q "'nowhere' is not an IPv4 or IPv6 address" "$scratch/said"
check address_that_is_none $?
"$tribend" view --listen 192.0.2.1 >"$scratch/said" 2>&1
[ $? = 5 ] && grep -qi 'cannot assign' "$scratch/said"
check address_of_another_machine $?
check_end

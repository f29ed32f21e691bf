#!/usr/bin/env bash
# Opens the sandbox on a virtual screen and uses it as a person would: keys, mouse, panels, saving. Fails if the first picture comes
# too late or black, if the program ends before it is told to, if it does not answer, if a stroke of a brush cannot be taken back, or
# if a picture is of one colour.
# Arguments: folder for pictures and the saved scene [out/smoke], scene [the hose].
# WEATHERING_PROGRAM: a program that is built already; WEATHERING_START_SECONDS: when the first picture has to be there [5].
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

out="${1:-out/smoke}"
scene="${2:-assets/scenarios/hose.ron}"
limit="${WEATHERING_START_SECONDS:-5}"
weathering="${WEATHERING_PROGRAM:-}"
if [ -z "${weathering}" ]; then
    build_program
    weathering="${CARGO_TARGET_DIR}/release/weathering"
fi
scratch="$(mktemp -d)"
mkdir -p "${out}"
rm -rf "${out}"/screenshot_*.png "${out}/saved"

screen_pid='' sandbox_pid=''
finish() {
    end "${sandbox_pid}" "${screen_pid}"
    rm -rf "${scratch}"
}
trap finish EXIT

fail() {
    echo "smoke: $*" >&2
    if [ -e "${scratch}/log" ]; then
        tail -n 40 "${scratch}/log" >&2
        # What comes after a panic may be long.
        grep -A 5 panicked "${scratch}/log" >&2 || true
    fi
    exit 1
}

virtual_screen "${scratch}" || fail "no screen"
# A header of big-endian words, colours, pixels of four bytes.
memory="${scratch}/Xvfb_screen0"
word() { od -An -tu4 --endian=big -j "$((4 * $1))" -N 4 "${memory}" | tr -d '[:space:]'; }
pixels_at=$(($(word 0) + 12 * $(word 19) + 1))

# Bytes of the screen that are neither 0 nor 255: none of a white screen or a black window.
lit() { tail -c "+${pixels_at}" "${memory}" | tr -d '\000\377' | wc -c; }
# Bytes that are 0: one of four in any case, more than half of all if there is a black window.
zeros() { tail -c "+${pixels_at}" "${memory}" | tr -dc '\000' | wc -c; }

milliseconds() { echo "$((${EPOCHREALTIME/[.,]/} / 1000))"; }

# Settings of its own: a run does not depend on the last one.
started="$(milliseconds)"
XDG_RUNTIME_DIR="${scratch}" XDG_CONFIG_HOME="${scratch}/config" \
    "${weathering}" sandbox "${scene}" --out "${out}" >"${scratch}/log" 2>&1 &
sandbox_pid=$!

alive() { kill -0 "${sandbox_pid}" 2>/dev/null || fail "the sandbox ended while: $1"; }

# Waits until a command succeeds: what is waited for, seconds, the command.
await() {
    local what="$1" end=$((SECONDS + $2))
    shift 2
    until "$@" >/dev/null 2>&1; do
        alive "waiting for ${what}"
        [ "${SECONDS}" -lt "${end}" ] || fail "waited in vain for ${what}"
        sleep 0.1
    done
}

# The first picture: nothing black before it.
while [ "$(lit)" -lt 100000 ]; do
    alive "waiting for the first picture"
    [ "$(zeros)" -lt 1400000 ] || fail "the window was black before its first picture"
    [ $(($(milliseconds) - started)) -lt 120000 ] || fail "no picture"
    sleep 0.02
done
took=$(($(milliseconds) - started))
echo "smoke: the first picture came after ${took} ms"
[ "${took}" -le $((limit * 1000)) ] || fail "the first picture took longer than ${limit} s"

window=''
find_window() {
    local found
    found="$(xdotool search --onlyvisible --name weathering)"
    window="${found%%$'\n'*}"
    [ -n "${window}" ]
}
await "a window" 20 find_window
timeout 20 xdotool windowfocus --sync "${window}" || fail "the window does not take the keyboard"
# Title and text: what the title ends with, but for brackets.
titled() { [[ "$(xdotool getwindowname "${window}")" == *"($1)" ]]; }
await "the scene" 60 titled running
echo "smoke: running after $(($(milliseconds) - started)) ms"

# The sandbox's own picture, without panels, and what is on the screen. Of one colour it is some three kilobytes at this size;
# any scene has ten times that.
shots=0
shot() {
    alive "$1"
    local own bytes
    own="${out}/screenshot_$(printf %03d "${shots}").png"
    xdotool key F12
    await "the picture of: $1" 60 test -s "${own}"
    bytes="$(stat -c %s "${own}")"
    [ "${bytes}" -gt 12000 ] || fail "${own} is black, or of one colour (${bytes} bytes), at: $1"
    [ "$(lit)" -gt 100000 ] || fail "the screen is black at: $1"
    shots=$((shots + 1))
}
shot "the first picture"

# The right button turns, the wheel comes closer, the left one sprays.
xdotool mousemove 640 300 mousedown 3
for _ in 1 2 3 4 5 6; do xdotool mousemove_relative 10 4; sleep 0.1; done
xdotool mouseup 3 click 4 click 4
shot "a turned camera"
xdotool mousemove 620 330 mousedown 1
for _ in 1 2 3 4 5 6 7 8; do xdotool mousemove_relative 8 2; sleep 0.2; done
xdotool mouseup 1
shot "the hose in the hand"

# A brush, and its stroke taken back.
xdotool key 1 mousemove 660 340 mousedown 1
for _ in 1 2 3 4 5 6; do xdotool mousemove_relative 12 3; sleep 0.2; done
xdotool mouseup 1
shot "a stroke of a brush"
xdotool key ctrl+z
await "the stroke to be taken back" 30 grep -q "took a stroke back" "${scratch}/log"
shot "a stroke taken back"

# Probe, maps, plots; then all panels in turn, by their key: where tabs are depends on how wide the window is.
xdotool key i mousemove 640 360 click 1 key m key p
shot "maps and plots"
xdotool key v
shot "how wet surfaces are, in false colours"
xdotool key v key v key v key v
for _ in 1 2 3 4 5 6 7 8 9 10; do
    xdotool key Next
    sleep 0.4
    alive "opening panels"
done
# Into the scene: whatever of the panels had the keyboard, has it no more.
xdotool key i mousemove 640 300 click 1
xdotool key F1
shot "the help"
xdotool key F1 key u
shot "no panels"
xdotool key u key space
await "a pause" 20 titled paused
xdotool key n key n key r
shot "one tick, started over"
xdotool key c key w key c key f key space
await "going on" 20 titled running
shot "going on"

# By its button, the third in the bar from the left, while water runs: panels act later in a frame than keys do.
restarts() { grep -c "started over" "${scratch}/log" || true; }
restarted() { [ "$(restarts)" -gt "${before}" ]; }
before="$(restarts)"
sleep 2
xdotool mousemove 147 13 click 1
await "the button" 20 restarted
xdotool mousemove 640 300
shot "started over by its button"

# It leaves when the scene is saved, and not before.
xdotool key r
xdotool key ctrl+s key Escape
for _ in $(seq 100); do kill -0 "${sandbox_pid}" 2>/dev/null || break; sleep 0.1; done
# The first one closes a list that is open, or has been asked whether to leave what is not saved.
if kill -0 "${sandbox_pid}" 2>/dev/null; then
    xdotool key Escape
    for _ in $(seq 300); do kill -0 "${sandbox_pid}" 2>/dev/null || break; sleep 0.1; done
fi
! kill -0 "${sandbox_pid}" 2>/dev/null || fail "it does not leave"
status=0
wait "${sandbox_pid}" || status=$?
sandbox_pid=''
[ "${status}" -eq 0 ] || fail "the sandbox ended with ${status}"
! grep -qi panicked "${scratch}/log" || fail "something panicked"
test -s "${scratch}/config/bevy_weathering/settings.ron" || fail "settings were not remembered"
test -s "${out}/saved/state.ron" || fail "the scene was not saved"
"${weathering}" replay "${scene}" --no-render --resume "${out}/saved" >"${scratch}/report" || fail "it cannot be gone on with"
echo "smoke: ${shots} pictures in ${out}"

#!/usr/bin/env bash
# Opens the sandbox on a virtual screen and uses it as a person would: keys, mouse, panels, another scene. Fails if the program
# ends before it is told to, or if a picture of the screen is black. Arguments: folder for the pictures [out/smoke], scene.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"
window_libraries
command -v Xvfb >/dev/null || install xvfb
command -v xdotool >/dev/null || install xdotool

out="${1:-out/smoke}"
scene="${2:-assets/scenarios/hose.ron}"
cargo build --release --bin weathering
weathering="${CARGO_TARGET_DIR}/release/weathering"
scratch="$(mktemp -d)"
mkdir -p "${out}"
rm -f "${out}"/*.png

screen_pid='' sandbox_pid=''
finish() {
    [ -z "${sandbox_pid}" ] || kill "${sandbox_pid}" 2>/dev/null || true
    [ -z "${screen_pid}" ] || kill "${screen_pid}" 2>/dev/null || true
    rm -rf "${scratch}"
}
trap finish EXIT

Xvfb -displayfd 3 -screen 0 1280x720x24 3>"${scratch}/display" 2>/dev/null &
screen_pid=$!
for _ in $(seq 100); do [ -s "${scratch}/display" ] && break; sleep 0.1; done
DISPLAY=":$(tr -d '[:space:]' <"${scratch}/display")"
export DISPLAY

# Settings of its own: a run does not depend on the last one.
XDG_RUNTIME_DIR="${scratch}" XDG_CONFIG_HOME="${scratch}/config" \
    "${weathering}" sandbox "${scene}" --out "${out}" >"${scratch}/log" 2>&1 &
sandbox_pid=$!

fail() {
    echo "smoke: $*" >&2
    tail -n 40 "${scratch}/log" >&2
    exit 1
}

alive() { kill -0 "${sandbox_pid}" 2>/dev/null || fail "the sandbox ended while: $1"; }

# Waits until a command succeeds: what is waited for, seconds, the command.
await() {
    local what="$1" end=$((SECONDS + $2))
    shift 2
    until "$@" >/dev/null 2>&1; do
        alive "waiting for ${what}"
        [ "${SECONDS}" -lt "${end}" ] || fail "waited in vain for ${what}"
        sleep 0.2
    done
}

titled() { xdotool getwindowname "${window}" | grep -qF "$1"; }

# A picture of one colour is some three kilobytes at this size; any scene has ten times that.
check_size() {
    local bytes
    bytes="$(stat -c %s "$1")"
    [ "${bytes}" -gt 12000 ] || fail "$1 is black, or of one colour (${bytes} bytes)"
}

# The sandbox's own picture, without panels, and one of the whole screen where there is a tool for it.
shots=0
shot() {
    alive "$1"
    local own="${out}/screenshot_$(printf %03d "${shots}").png"
    xdotool key F12
    await "the picture of: $1" 60 test -s "${own}"
    check_size "${own}"
    if command -v import >/dev/null; then
        import -window root "${out}/screen_$(printf %03d "${shots}").png"
        check_size "${out}/screen_$(printf %03d "${shots}").png"
    elif command -v xwd >/dev/null; then
        local lit
        xwd -root -silent -out "${scratch}/screen.xwd"
        lit="$(tail -c +4096 "${scratch}/screen.xwd" | tr -d '\000\377' | wc -c)"
        [ "${lit}" -gt 100000 ] || fail "the screen is black at: $1"
    fi
    shots=$((shots + 1))
}

started="${SECONDS}"
window=''
find_window() { window="$(xdotool search --name weathering | head -n 1)" && [ -n "${window}" ]; }
until find_window; do
    alive "opening a window"
    [ $((SECONDS - started)) -lt 60 ] || fail "no window"
    sleep 0.2
done
xdotool windowfocus --sync "${window}"
await "the scene" 120 titled "(running)"
echo "smoke: running after $((SECONDS - started)) s"
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
shot "a stroke taken back"

# Probe, maps, plots, help; all panels by their tabs, which lie in the first rows of the left panel.
xdotool key i mousemove 640 360 click 1 key m key p
shot "maps and plots"
xdotool key v
shot "how wet surfaces are, in false colours"
xdotool key v key v key v key v
for x in 30 80 130 190 250; do
    for y in 52 74; do
        xdotool mousemove "${x}" "${y}" click 1
        sleep 0.2
        alive "opening panels"
    done
done
xdotool key F1
shot "the help"
xdotool key F1 key u
shot "no panels"
xdotool key u key space
await "a pause" 20 titled "(paused)"
xdotool key n key n key r
shot "one tick, started over"
xdotool key c key w key c key f key space
await "going on" 20 titled "(running)"
shot "going on"

xdotool key Escape
for _ in $(seq 100); do kill -0 "${sandbox_pid}" 2>/dev/null || break; sleep 0.1; done
status=0
wait "${sandbox_pid}" || status=$?
sandbox_pid=''
[ "${status}" -eq 0 ] || fail "the sandbox ended with ${status}"
grep -qi panicked "${scratch}/log" && fail "something panicked"
test -s "${scratch}/config/bevy_weathering/settings.ron" || fail "settings were not remembered"
echo "smoke: ${shots} pictures in ${out}"

#!/usr/bin/env bash
# Renders the pictures of README.md and GALLERY.md anew, into docs/pictures. Arguments: names of scenarios, or `sandbox` [all].
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

build_program
folder="$(mktemp -d)"
screen_pid='' sandbox_pid=''
finish() {
    end "${sandbox_pid}" "${screen_pid}"
    rm -rf "${folder}"
}
trap finish EXIT
mkdir -p docs/pictures

# picture SCENARIO SIZE (FRAME AS)...: one frame a second of weather; of these, the ones wanted, under their names.
picture() {
    local scenario="$1" size="$2"
    shift 2
    if [ -n "${wanted}" ] && [[ " ${wanted} " != *" ${scenario} "* ]]; then
        return
    fi
    "${CARGO_TARGET_DIR}/release/weathering" replay "assets/scenarios/${scenario}.ron" --fps 1 --size "${size}" \
        --out "${folder}/${scenario}"
    while [ "$#" -gt 0 ]; do
        cp "${folder}/${scenario}/frame_$1.png" "docs/pictures/$2.png"
        shift 2
    done
}

# sandbox SCENARIO AS: the sandbox on a screen of its own, with its panels, after somebody has sprayed.
sandbox() {
    if [ -n "${wanted}" ] && [[ " ${wanted} " != *" sandbox "* ]]; then
        return
    fi
    virtual_screen "${folder}"
    mkdir -p "${folder}/config/bevy_weathering" "${folder}/sandbox"
    echo '(panels_in_pictures: true, panel: "Materials")' >"${folder}/config/bevy_weathering/settings.ron"
    XDG_CONFIG_HOME="${folder}/config" "${CARGO_TARGET_DIR}/release/weathering" sandbox "assets/scenarios/$1.ron" \
        --out "${folder}/sandbox" >"${folder}/log" 2>&1 &
    sandbox_pid=$!
    local window=''
    until window="$(xdotool search --onlyvisible --name 'weathering.*running')"; do
        kill -0 "${sandbox_pid}" 2>/dev/null || { cat "${folder}/log" >&2; exit 1; }
        sleep 0.5
    done
    xdotool windowfocus --sync "${window%%$'\n'*}" mousemove 610 220 mousedown 1
    for _ in 1 2 3 4 5 6 7 8; do
        xdotool mousemove_relative 10 12
        sleep 1
    done
    xdotool mouseup 1 mousemove 800 200 key F12
    for _ in $(seq 100); do [ ! -s "${folder}/sandbox/screenshot_000.png" ] || break; sleep 0.2; done
    cp "${folder}/sandbox/screenshot_000.png" "docs/pictures/$2.png"
    end "${sandbox_pid}" "${screen_pid}"
    sandbox_pid='' screen_pid=''
}

wanted="$*"
sandbox vase sandbox
picture hose 1024x576 00006 hose
picture vase 576x576 00005 vase
for scenario in bricks flowerpot stone_on_sand porosity_row models cloth; do
    picture "${scenario}" 640x360 00000 "${scenario}_dry" 00004 "${scenario}_wet"
done
picture regions 1024x576 00005 regions
picture bas_relief 640x480 00001 bas_relief_dry 00008 bas_relief_rain 00039 bas_relief_wet
picture drying 640x480 00003 drying_wet 00016 drying_half 00034 drying_late
picture roof_edge 640x480 00030 roof_edge
picture rain 640x480 00010 rain
picture dust 640x480 00013 dust
picture snow 640x480 00015 snow
picture wash 640x480 00012 wash
picture mud 640x480 00003 mud
picture stair 640x480 00020 stair_rain 00050 stair_puddles

#!/usr/bin/env bash
# Installs what is missing, builds, and runs `weathering` with the given arguments. Without arguments: the sandbox
# if there is a display, else the hose scenario into out/.
set -euo pipefail
invoked_from="${PWD}"
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

[ -z "${DISPLAY:-}" ] || window_libraries
build_program
weathering="${CARGO_TARGET_DIR}/release/weathering"
if [ "$#" -gt 0 ]; then
    cd "${invoked_from}"
    exec "${weathering}" "$@"
elif [ -n "${DISPLAY:-}" ]; then
    exec "${weathering}" sandbox assets/scenarios/hose.ron
else
    exec "${weathering}" replay assets/scenarios/hose.ron --out out --fps 12
fi

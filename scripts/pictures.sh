#!/usr/bin/env bash
# Renders the pictures of the README anew, into docs/pictures.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

cargo build --release --bin weathering
folder="$(mktemp -d)"
trap 'rm -rf "${folder}"' EXIT
# picture NAME SCENARIO SIZE FRAME: one frame a second of weather.
picture() {
    "${CARGO_TARGET_DIR}/release/weathering" replay "assets/scenarios/$2.ron" --fps 1 --size "$3" --out "${folder}/$1"
    cp "${folder}/$1/frame_$4.png" "docs/pictures/$1.png"
}
mkdir -p docs/pictures
picture hose hose 1024x576 00006
picture vase vase 576x576 00005

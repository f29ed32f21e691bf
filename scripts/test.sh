#!/usr/bin/env bash
# Installs what is missing and runs all tests, those on the graphics driver included; with arguments, what `cargo test` makes of
# them.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

# The window test opens one on a virtual screen and presses keys in it.
window_libraries
command -v Xvfb >/dev/null || install xvfb
command -v xdotool >/dev/null || install xdotool

if [ "$#" -gt 0 ]; then
    exec cargo test --release "$@"
fi
cargo test --release --lib --bins --tests --examples
cargo test --release --doc

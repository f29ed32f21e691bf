#!/usr/bin/env bash
# Sourced by the other scripts: installs what is missing and sets where things go.

cd "$(dirname "${BASH_SOURCE[0]}")/.."

# One folder for all checkouts and for CI, so that Bevy is built once.
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-${HOME}/.cache/bevy_weathering/target}"
# Vulkan's window-system code wants one even when no window is opened.
if [ -z "${XDG_RUNTIME_DIR:-}" ]; then
    XDG_RUNTIME_DIR="${TMPDIR:-/tmp}/bevy_weathering-runtime-$(id -u)"
    mkdir -p -m 700 "${XDG_RUNTIME_DIR}"
    export XDG_RUNTIME_DIR
fi

# install PACKAGE...: Debian/Ubuntu packages, when apt-get is there and may be used.
install() {
    local sudo=""
    [ "$(id -u)" = 0 ] || sudo="sudo"
    if ! command -v apt-get >/dev/null || { [ -n "${sudo}" ] && ! command -v sudo >/dev/null; }; then
        echo "missing: $*; install it with this system's package manager" >&2
        return 1
    fi
    echo "installing $*" >&2
    ${sudo} env DEBIAN_FRONTEND=noninteractive apt-get update -qq
    ${sudo} env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

if ! command -v cargo >/dev/null; then
    echo "cargo is missing: install Rust 1.95 or later with rustup" >&2
    exit 1
fi
command -v cc >/dev/null || install gcc libc6-dev
# A Vulkan driver of any kind; Mesa's runs on the CPU.
has_driver() {
    local manifest
    for manifest in "${VK_ICD_FILENAMES:-}" /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json; do
        if [ -e "${manifest}" ]; then return 0; fi
    done
    return 1
}
has_driver || install mesa-vulkan-drivers
# has_library NAME. The loader's list comes first into a variable: `grep -q` would leave a pipe that `pipefail` sees break.
has_library() {
    local libraries
    libraries="$(PATH="${PATH}:/sbin:/usr/sbin" ldconfig -p 2>/dev/null || true)"
    [ -z "${libraries##*"$1"*}" ]
}
has_library libvulkan.so.1 || install libvulkan1

# window_libraries: what opening a window loads at run time.
window_libraries() {
    local library
    for library in libX11-xcb.so.1 libXcursor.so.1 libXi.so.6 libxkbcommon-x11.so.0; do
        if ! has_library "${library}"; then
            install libx11-6 libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0
            return
        fi
    done
}

# virtual_screen FOLDER: a white screen of 1280 by 720 as DISPLAY, and the process behind it as screen_pid, to be ended by the caller. The
# server keeps what is on the screen in FOLDER/Xvfb_screen0.
virtual_screen() {
    window_libraries
    command -v Xvfb >/dev/null || install xvfb
    command -v xdotool >/dev/null || install xdotool
    Xvfb -noreset -displayfd 3 -screen 0 1280x720x24 -wr -fbdir "$1" 3>"$1/display" 2>/dev/null &
    screen_pid=$!
    for _ in $(seq 100); do [ ! -s "$1/display" ] || break; sleep 0.1; done
    if [ ! -s "$1/display" ]; then
        echo "Xvfb does not start" >&2
        return 1
    fi
    DISPLAY=":$(tr -d '[:space:]' <"$1/display")"
    export DISPLAY
}

# end PID...: ends processes that were started here, and waits for them. Empty ones are none.
end() {
    local pid
    for pid in "$@"; do
        [ -z "${pid}" ] || { kill "${pid}" && wait "${pid}"; } 2>/dev/null || true
    done
}

# build_program [OPTION...]: builds `weathering`, and an example with it. What tests and examples depend on switches on features of
# what Bevy depends on; a build without them would be another Bevy than the one of the tests, and take its time once more.
build_program() {
    cargo build --release --bin weathering --example minimal "$@"
}

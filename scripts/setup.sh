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
if ! ls /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json >/dev/null 2>&1 && [ -z "${VK_ICD_FILENAMES:-}" ]; then
    install mesa-vulkan-drivers
fi
ldconfig -p 2>/dev/null | grep -q libvulkan.so.1 || install libvulkan1

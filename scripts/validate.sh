#!/usr/bin/env bash
# Holds baked scenes against the Khronos glTF validator, if that is installed (https://github.com/KhronosGroup/glTF-Validator,
# the program `gltf_validator`). Fails if it finds an error; warnings and hints are shown. Arguments: .glb files [a bake of the
# bunny].
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

validator="$(command -v gltf_validator || true)"
if [ -z "${validator}" ]; then
    echo "validate: gltf_validator is not installed; nothing was checked" >&2
    exit 0
fi

if [ $# -eq 0 ]; then
    source scripts/setup.sh
    cargo build --release --bin weathering
    "${CARGO_TARGET_DIR}/release/weathering" bake assets/models/bunny_1000.glb --rain 20 --minutes 1 --size 128 \
        --out out/validate
    set -- out/validate/bunny_1000_weathered.glb
fi

failed=0
for file in "$@"; do
    # It ends with an error if there are any, but the report says what they are.
    report="$("${validator}" -o "${file}" || true)"
    if grep -Eq '"numErrors": *0[,}[:space:]]' <<<"${report}"; then
        echo "${file}: no errors"
        grep -E '"num(Warnings|Infos|Hints)"' <<<"${report}" || true
    else
        echo "${file}: the validator finds errors" >&2
        echo "${report}" >&2
        failed=1
    fi
done
exit "${failed}"

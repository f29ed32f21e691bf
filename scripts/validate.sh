#!/usr/bin/env bash
# Holds exported scenes against the Khronos glTF validator (https://github.com/KhronosGroup/glTF-Validator): the program
# `gltf_validator`, or else node with the package `gltf-validator` of npm, which is installed into a temporary folder unless
# NODE_PATH has it. Fails if the validator finds an error, or if there is none; warnings, infos and hints are counted.
# Arguments: .glb files. Without any: a bake of the bunny, and what the tests export: several meshes with instances and uvs that
# tile, skinned and morphed ones, running apps, a scenario.
set -euo pipefail
caller="${PWD}"
cd "$(dirname "${BASH_SOURCE[0]}")/.."

temporary="$(mktemp -d)"
trap 'rm -rf "${temporary}"' EXIT

# Writes the report of a file as JSON; the same by both.
validate_with_program() { gltf_validator -o "$1"; }
validate_with_node() {
    node -e '
        const { readFileSync } = require("fs");
        const options = { uri: process.argv[1], maxIssues: 100 };
        require("gltf-validator").validateBytes(new Uint8Array(readFileSync(process.argv[1])), options)
            .then((report) => console.log(JSON.stringify(report, null, 2)))
            .catch((error) => { console.error(String(error)); process.exit(1); });
    ' "$1"
}

has_package() { node -e 'require("gltf-validator")' 2>/dev/null; }

if command -v gltf_validator >/dev/null; then
    validate=validate_with_program
elif command -v node >/dev/null && { has_package || command -v npm >/dev/null; }; then
    validate=validate_with_node
    if ! has_package; then
        echo "installing gltf-validator into ${temporary}" >&2
        npm install --silent --no-audit --no-fund --prefix "${temporary}" gltf-validator@2.0.0-dev.3.10 >&2
        export NODE_PATH="${temporary}/node_modules"
        has_package
    fi
else
    echo "validate: needs gltf_validator, or node and npm; nothing was checked" >&2
    exit 2
fi

if [ $# -eq 0 ]; then
    source scripts/setup.sh
    build_program
    "${CARGO_TARGET_DIR}/release/weathering" bake assets/models/bunny_1000.glb --rain 20 --minutes 1 --size 128 \
        --out "${temporary}/bunny" >/dev/null
    WEATHERING_EXPORTS="${temporary}/exports" cargo test --release --test main -- export::
    set -- "${temporary}"/bunny/*.glb "${temporary}"/exports/*_weathered.glb
    # Each by its name: that one is missing must not go unnoticed.
    for name in scene skinned skinned_and_cut morphed morphed_and_cut app garden; do
        if [ ! -e "${temporary}/exports/${name}_weathered.glb" ]; then
            echo "validate: the tests exported no ${name}" >&2
            exit 1
        fi
    done
fi

failed=0
for file in "$@"; do
    case "${file}" in
        /*) path="${file}" ;;
        *) path="${caller}/${file}" ;;
    esac
    # It ends with an error if there are any, but the report says what they are.
    report="$("${validate}" "${path}" || true)"
    if grep -Eq '"numErrors": *0[,}[:space:]]' <<<"${report}"; then
        counts="$(grep -oE '"num(Warnings|Infos|Hints)": *[0-9]+' <<<"${report}" | tr -d '":' | tr '\n' ',')"
        echo "${file##*/}: no errors; ${counts%,}"
    else
        echo "${file}: the validator finds errors, or cannot read it" >&2
        echo "${report}" >&2
        failed=1
    fi
done
exit "${failed}"

#!/usr/bin/env bash
# Compares digests of this package built with and without optimisation (and then with checks of overflow, and assertions), on 1, 2
# and 8 threads. The tests compare threads, drivers, and runs with pictures and without; what is built another way, they cannot.
# Arguments: scenarios [hose, shower, mud, snow, dust].
# WEATHERING_WHOLE_DEBUG=1: all that it depends on without optimisation, too. That builds Bevy once more: half an hour on two
# cores, and some gigabytes. WEATHERING_SECONDS: of weather, of each scenario [2].
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

seconds="${WEATHERING_SECONDS:-2}"
if [ "$#" -eq 0 ]; then
    set -- assets/scenarios/{hose,shower,mud,snow,dust}.ron
fi
scratch="$(mktemp -d)"
trap 'rm -rf "${scratch}"' EXIT

if [ "${WEATHERING_WHOLE_DEBUG:-}" = 1 ]; then
    # Nobody looks into it with a debugger.
    CARGO_PROFILE_DEV_DEBUG=0 CARGO_PROFILE_DEV_INCREMENTAL=false cargo build --bin weathering
    cp "${CARGO_TARGET_DIR}/debug/weathering" "${scratch}/plain"
else
    # The profile of what it depends on stays, so nothing of that is built again.
    package=profile.release.package.bevy_weathering
    build_program --config "${package}.opt-level=0" \
        --config "${package}.debug-assertions=true" --config "${package}.overflow-checks=true"
    cp "${CARGO_TARGET_DIR}/release/weathering" "${scratch}/plain"
fi
build_program
cp "${CARGO_TARGET_DIR}/release/weathering" "${scratch}/optimised"

# digest PROGRAM SCENARIO THREADS. Exit code 1: something is not as the scenario expects it, which need not hold so early.
digest() {
    local status=0
    "${scratch}/$1" replay "$2" --no-render --seconds "${seconds}" --threads "$3" >"${scratch}/report" || status=$?
    [ "${status}" -le 1 ] || return "${status}"
    sed -n 's/^  "digest": "\([0-9a-f]*\)".*/\1/p' "${scratch}/report"
}

failed=0
for scenario in "$@"; do
    reference=''
    for program in optimised plain; do
        for threads in 1 2 8; do
            found="$(digest "${program}" "${scenario}" "${threads}")"
            [ -n "${found}" ] || { echo "digests: no digest of ${scenario}" >&2; exit 1; }
            reference="${reference:-${found}}"
            if [ "${found}" != "${reference}" ]; then
                echo "${scenario}, ${program}, ${threads} threads: ${found}, and not ${reference}" >&2
                failed=1
            fi
        done
    done
    echo "${scenario}: ${reference}"
done
exit "${failed}"

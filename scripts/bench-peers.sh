#!/usr/bin/env bash
# bench-peers.sh [ARGUMENT...]: other programs at the same job, by benches/peers.py (or what PEERS
# names there), which takes the arguments. What is missing for them is installed or, where that cannot be, said.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/packages.sh
. scripts/packages.sh

missing=()

# need REASON PACKAGE...: notes the packages and says why.
need() {
    echo "missing: ${*:2} ($1)"
    missing+=("${@:2}")
}

has_library() {
    ldconfig -p | grep -q "$1"
}

PATH=$PATH:/usr/sbin:/sbin
python3 -c "import ensurepip, venv" 2>/dev/null || need "for the programs' own folder" python3-venv
has_library libusb-1.0.so.0 || need "Open3D loads it" libusb-1.0-0
has_library libGL.so.1 || need "Open3D loads it" libgl1
has_library libX11.so.6 || need "Open3D loads it" libx11-6
has_library libgomp.so.1 || need "Open3D loads it" libgomp1
has_library libLLVM || need "Mitsuba's variant for processors compiles with it" libllvm19
# Without them the programs that want them are left out, by name.
[ ${#missing[@]} -eq 0 ] || install_packages "${missing[@]}" || true

target=${CARGO_TARGET_DIR:-target}
# Where Debian has the library without the name that Mitsuba looks for.
for library in /usr/lib/*/libLLVM.so.19.1; do
    [ ! -e "$library" ] || export DRJIT_LIBLLVM_PATH="${DRJIT_LIBLLVM_PATH:-$library}"
done
python3 "benches/${PEERS:-peers.py}" "$target/release/etendue" "$target/release/benchmarks" "$@"

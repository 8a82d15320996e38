#!/usr/bin/env bash
# setup.sh [test]: installs what the build (or also the tests) needs and this machine lacks. Says
# what and why first; does nothing, and asks no server, when all is there.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/packages.sh
. scripts/packages.sh

any_file() {
    compgen -G "$1" >/dev/null
}

has_embree() {
    [ -n "${EMBREE_DIR:-}" ] || any_file "/usr/include/embree[34]/rtcore.h" ||
        any_file "/usr/local/include/embree[34]/rtcore.h"
}

# The library and the headers of its compiler (stddef.h), which come in packages of their own.
has_libclang() {
    [ -n "${LIBCLANG_PATH:-}" ] || { any_file "/usr/lib/llvm-*/lib/libclang*.so*" &&
        any_file "/usr/lib/llvm-*/lib/clang/*/include/stddef.h"; }
}

command -v cc >/dev/null || need "to link Rust programs" gcc libc6-dev
command -v c++ >/dev/null || need "to build meshoptimizer, which decodes compressed glTF" g++
has_embree || need "to intersect rays with meshes: Embree" libembree-dev
has_libclang || need "to read Embree's header" libclang-dev
[ -e /etc/ssl/certs/ca-certificates.crt ] || need "for cargo to fetch crates over TLS" ca-certificates
if [ "${1:-}" = test ]; then
    command -v exrheader >/dev/null || need "to read images back with OpenEXR's own tool" openexr
    python3 -c "import ensurepip, venv" 2>/dev/null ||
        need "to read images back with Python's OpenEXR and numpy" python3-venv
    { command -v Xvfb && command -v xdotool && command -v import && command -v jq; } >/dev/null ||
        need "to drive a window on a screen in memory" xvfb xdotool imagemagick jq
    { command -v sway && command -v grim && command -v wtype; } >/dev/null ||
        need "to drive a window on Wayland" sway grim wtype
    ldconfig -p | grep -q libwayland-egl.so.1 || need "to draw a window on Wayland" libwayland-egl1
    ldconfig -p | grep -q libxkbcommon-x11 && any_file "/usr/lib/*/dri/*_dri.so" ||
        need "to draw a window without a graphics card: Mesa and X's libraries" \
            libgl1-mesa-dri libgl1 libegl1 libxkbcommon-x11-0 libxcursor1 libxi6 libx11-xcb1
fi

if [ ${#missing[@]} -gt 0 ]; then
    install_packages "${missing[@]}"
fi

if ! command -v cargo >/dev/null; then
    echo "Rust is missing. Install it, open a new shell, and try again:" >&2
    echo "  curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh" >&2
    exit 1
fi
wanted=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
found=$(rustc --version | cut -d' ' -f2)
if [ "$(printf '%s\n' "$wanted" "$found" | sort -V | head -n 1)" != "$wanted" ]; then
    echo "Rust $found is here, but etendue needs $wanted or newer. Update it: rustup update stable" >&2
    exit 1
fi

# Rustup's minimal profile comes without these two.
if [ "${1:-}" = test ]; then
    for component in rustfmt clippy; do
        "cargo-${component/rustfmt/fmt}" --version >/dev/null 2>&1 ||
            rustup component add "$component"
    done
    # Not optimised: that takes a third of the time, and it runs for seconds.
    if ! cargo deny --version >/dev/null 2>&1; then
        echo "cargo-deny is missing, which checks licences and advisories: installing it takes some minutes, once"
        cargo install cargo-deny --locked --debug --quiet ||
            echo "cargo-deny could not be installed: licences and advisories will not be checked" >&2
    fi
fi

#!/usr/bin/env bash
# The pure-Rust renderer for other systems, as far as that goes from Linux: the command and the library are checked for macOS
# (Intel and Apple's); the command is linked for Windows by Zig, and where Wine is installed it renders a scene there, to the
# same bits. Rust's targets come by rustup, cargo-zigbuild and Zig from PyPI. Windows by Microsoft's compiler cannot be checked
# from here: a dependency (stacker) has C that includes windows.h, which is Microsoft's.
# check-platforms.sh macos|windows does one of them.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# Zig is also the compiler of what is C: Rust's crates ask for one even where nothing is linked.
tools=$PWD/out/platforms/venv
renderer=(-p etendue -p etendue-cli --no-default-features --locked)

step() {
    printf '\n==> %s\n' "$1"
}

install_tools() {
    command -v rustup >/dev/null || {
        echo "rustup is missing, which adds Rust's targets: see https://rustup.rs" >&2
        exit 1
    }
    if [ ! -x "$tools/bin/cargo-zigbuild" ]; then
        mkdir -p "$(dirname "$tools")"
        python3 -m venv "$tools"
        "$tools/bin/pip" install --quiet --disable-pip-version-check 'cargo-zigbuild>=0.20,<1' 'ziglang>=0.13,<1'
    fi
    PATH=$tools/bin:$PATH
}

# check TARGET...: every line of Rust of the command and the library, and of what they take from elsewhere.
check() {
    local target
    for target in "$@"; do
        step "cargo check for $target"
        rustup target add "$target"
        cargo-zigbuild check --target "$target" "${renderer[@]}"
    done
}

# Rust takes random numbers from bcryptprimitives.dll, which Wine has from version 9 on: for older ones a library that asks
# the older function of the same kind, in the folder of the program.
random_numbers() {
    local source=$tools/bcryptprimitives.c
    printf '%s\n' '#include <windows.h>' '#include <ntsecapi.h>' \
        '__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE to, SIZE_T count) { return RtlGenRandom(to, (ULONG)count); }' \
        >"$source"
    "$tools/bin/python" -m ziglang cc -target x86_64-windows-gnu -shared -o "$1/bcryptprimitives.dll" "$source" -ladvapi32
}

# The command as a program of Windows; with Wine it is run, and compared with what this machine's own renders by `bvh`.
windows() {
    local target=x86_64-pc-windows-gnu program wine out=$PWD/out/platforms/windows
    step "linking for $target"
    rustup target add "$target"
    cargo-zigbuild zigbuild --target "$target" -p etendue-cli --no-default-features --locked
    program=target/$target/debug/etendue.exe
    wine=$(command -v wine64 || command -v wine || { find /usr/lib/wine -name wine64 2>/dev/null || true; } | head -n 1)
    if [ -z "$wine" ]; then
        echo "not run: Wine is not installed (Debian: wine64)"
        return
    fi
    step "running it by Wine"
    rm -rf "$out"
    mkdir -p "$out"
    export WINEPREFIX=$PWD/out/platforms/wine WINEDEBUG=-all
    random_numbers "$(dirname "$program")"
    "$wine" "$program" --version
    "$wine" "$program" render scenes/cube.json -o "$out/there" -q
    "${ETENDUE:-target/debug/etendue}" render scenes/cube.json -o "$out/here" --accel bvh -q
    cmp "$out/here/distance.npy" "$out/there/distance.npy"
    # Refusals end as they do here.
    local code=0
    "$wine" "$program" render no-such.json -o "$out/none" 2>"$out/said" || code=$?
    [ "$code" -eq 2 ] && grep -q "no-such.json" "$out/said" || {
        echo "a file that is not there ends with exit code $code: $(cat "$out/said")" >&2
        exit 1
    }
    echo "Distances of scenes/cube.json are the same to the bit."
}

case "${1:-all}" in
macos | windows | all) ;;
*)
    echo "usage: scripts/check-platforms.sh [macos|windows]" >&2
    exit 2
    ;;
esac
install_tools
[ "${1:-all}" = windows ] || check x86_64-apple-darwin aarch64-apple-darwin
[ "${1:-all}" = macos ] || windows

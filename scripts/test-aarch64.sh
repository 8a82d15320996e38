#!/usr/bin/env bash
# The pure-Rust renderer for ARM (aarch64): built by Debian's cross compiler, and tested by QEMU's emulation of a program. It
# installs the two with apt and Rust's target with rustup. Arguments choose tests, as nextest's -E does.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/packages.sh
. scripts/packages.sh

target=aarch64-unknown-linux-gnu
compiler=aarch64-linux-gnu
command -v $compiler-g++ >/dev/null || need "to link, and to build meshoptimizer, for ARM" gcc-$compiler g++-$compiler
command -v qemu-aarch64 >/dev/null || need "to run programs for ARM" qemu-user
[ ${#missing[@]} -eq 0 ] || install_packages "${missing[@]}"
command -v rustup >/dev/null || {
    echo "rustup is missing, which adds Rust's target: see https://rustup.rs" >&2
    exit 1
}
rustup target add $target

export CC_aarch64_unknown_linux_gnu=$compiler-gcc CXX_aarch64_unknown_linux_gnu=$compiler-g++
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=$compiler-gcc
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64 -L /usr/$compiler"

# What tests start as programs of their own, the command among them, wants the kernel's binfmt_misc, so the command is run by
# hand; and before the tests, which are slow under QEMU.
cargo build --target $target --locked --no-default-features -p etendue-cli
there=(qemu-aarch64 -L "/usr/$compiler" "target/$target/debug/etendue")
out=out/aarch64
rm -rf "$out"
"${there[@]}" --version
"${there[@]}" render scenes/cube.json -o "$out/there" -q
"${ETENDUE:-target/debug/etendue}" render scenes/cube.json -o "$out/here" --accel bvh -q
cmp "$out/here/distance.npy" "$out/there/distance.npy"
echo "Distances of scenes/cube.json are the same to the bit on both."

# As test.sh: with nextest when it is installed, else with cargo's own runner.
packages=()
for crate in files geometry image spectrum accel optics camera sensor tracer scene render; do packages+=(-p "etendue-$crate"); done
arguments=(--target $target --locked --no-default-features "${packages[@]}")
if cargo nextest --version >/dev/null 2>&1; then
    cargo nextest run "${arguments[@]}" --no-fail-fast "$@"
else
    cargo test --lib --tests "${arguments[@]}" "$@"
fi

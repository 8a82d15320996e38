#!/usr/bin/env bash
# Runs the tests that touch Embree against Embree 4, in a Debian 13 root below target/. test-embree4.sh --library leaves
# out those of the command, which calls the same library; --root makes the root alone.
#
# The root is made once (a minute) and kept, and so is what cargo builds for it. All mounts live in a
# mount namespace of their own: they end with the process, however it ends, and nobody else sees them.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/packages.sh
. scripts/packages.sh

PATH=$PATH:/usr/sbin:/sbin
root=target/trixie
packages=libembree-dev,libclang-dev,gcc,g++,libc6-dev,ca-certificates

# Without CI, not being able to is no failure, but is said.
skip() {
    echo "Embree 4 is not tested: $1" >&2
    [ -z "${CI:-}" ] && exit 0
    exit 1
}

# in_namespace SCRIPT ARGUMENT...: as root, where mounts are private; paths arrive as arguments.
in_namespace() {
    as_root unshare --mount --propagation private bash -euc "$1" in_namespace "${@:2}"
}

make_root() {
    echo "Making a Debian 13 root with Embree 4 in $root, by debootstrap."
    if ! command -v debootstrap >/dev/null; then
        echo "missing: debootstrap (to unpack a Debian 13 root)"
        install_packages debootstrap || return
    fi
    as_root rm -rf "$root.part"
    mkdir -p "$root.part"
    # By way of /mnt, because debootstrap cannot live with a space in the path.
    # shellcheck disable=SC2016
    in_namespace 'mount --bind "$1" /mnt; debootstrap --variant=minbase --include="$2" trixie /mnt' \
        "$PWD/$root.part" "$packages" &&
        as_root mkdir -p "$root.part"/assets "$root.part"/target/debug &&
        as_root chown -R "$(id -u):$(id -g)" "$root.part/target" &&
        mv "$root.part" "$root"
}

if [ -e /usr/include/embree4/rtcore.h ] && [ -z "${EMBREE_DIR:-}" ]; then
    echo "Embree 4 is this machine's own, and the workspace's tests use it."
    exit
fi
may_be_root || skip "making a Debian 13 root and entering it takes root, or sudo."
why=$(in_namespace true 2>&1) || skip "this system lets not even root mount ($why)."
# A root of an earlier time may lack the C++ compiler.
[ -e "$root/usr/bin/g++" ] || make_root || skip "debootstrap could not make the Debian 13 root; see above."
[ "${1:-}" != --root ] || exit 0

# What does not trace, or traces by `bvh` in the tests of the workspace, too, is not run twice.
elsewhere=$(printf -- '--skip %s:: ' files gallery inputs lamps lens lens_pictures lens_reference light_fields memory models \
    openings_and_glasses shards stopping waves)

parts="-p etendue-dependencies -p etendue-embree-sys -p etendue-accel -p etendue-stability -p etendue"
[ "${1:-}" = --library ] || parts+=" -p etendue-cli"

# Everything from here on is offline. The toolchain is entered directly: rustup stays outside. Checkout, cargo and toolchain
# have the paths that they have outside, and what cargo has built there lies below an overlay: what does not ask which
# Embree there is, is taken as it is, and what is built anew stays in target/trixie-debug.
cargo fetch --locked --target "$(rustc --version --verbose | sed -n 's/^host: //p')"
mkdir -p target/debug target/trixie-debug/upper target/trixie-debug/work
# shellcheck disable=SC2016
in_namespace '
    root=$1 cargo=$2 toolchain=$3 assets=$4 user=$5 checkout=$PWD
    mount --bind "$root" /mnt
    for system in proc sys dev; do mount --rbind "/$system" "/mnt/$system"; done
    mkdir -p "/mnt$checkout" "/mnt$cargo" "/mnt$toolchain" /mnt/target/debug
    mount --bind -o ro . "/mnt$checkout"
    mount --bind -o ro "$cargo" "/mnt$cargo"
    mount --bind -o ro "$toolchain" "/mnt$toolchain"
    [ -z "$assets" ] || mount --bind -o ro "$assets" /mnt/assets
    mount --bind /mnt/target "/mnt$checkout/target"
    mount -t overlay overlay "/mnt$checkout/target/debug" \
        -o lowerdir=target/debug,upperdir=target/trixie-debug/upper,workdir=target/trixie-debug/work ||
        echo "This system has no overlays to build on: all is built once more."
    exec chroot --userspec="$user" /mnt env -i HOME=/tmp LANG=C.UTF-8 PATH="$toolchain/bin:/usr/bin:/bin" \
        CARGO_HOME="$cargo" ${assets:+ETENDUE_ASSETS=/assets} \
        CARGO_INCREMENTAL="${CARGO_INCREMENTAL:-1}" CARGO_PROFILE_DEV_DEBUG="${CARGO_PROFILE_DEV_DEBUG:-line-tables-only}" \
        sh -c "cd \"\$1\"; exec cargo test --offline --locked $7 -- $6" sh "$checkout"
' "$PWD/$root" "$(realpath "${CARGO_HOME:-$HOME/.cargo}")" "$(rustc --print sysroot)" "${ETENDUE_ASSETS:-}" \
    "$(id -u):$(id -g)" "$elsewhere" "$parts"

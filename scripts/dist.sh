#!/usr/bin/env bash
# What others install, in out/dist: a tarball, a Debian package and a Python wheel, each with the Embree and
# TBB of this machine beside the program, and each tried in bare Debian 12 and 13 roots.
# dist.sh build makes them, dist.sh try tries them; without a word it does both. PROFILE=dev builds as the
# tests of Rust do: to try this script, not for users.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/packages.sh
. scripts/packages.sh

PATH=$PATH:/usr/sbin:/sbin:$PWD/out/tools/bin
dist=out/dist
profile="${PROFILE:-release}"
program=target/$([ "$profile" = dev ] && echo debug || echo "$profile")/etendue
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
name="etendue-$version-linux-$(uname -m)"

# The libraries that the program finds beside it, under the names that it asks for.
bundle_libraries() {
    mkdir -p "$dist/lib"
    ldd "$program" | awk '$1 ~ /^lib(embree|tbb)/ { print $1, $3 }' | while read -r soname path; do
        install -m 644 "$path" "$dist/lib/$soname"
    done
}

# What is built into the command, and the libraries beside it, with their terms.
write_notices() {
    local libraries=()
    while read -r path; do libraries+=(--library "$path"); done < <(
        ldd "$program" | awk '$1 ~ /^lib(embree|tbb)/ { print $3 }')
    python3 scripts/notices.py etendue-cli "$dist/THIRD-PARTY-NOTICES.txt" "${libraries[@]}"
}

build_tarball() {
    rm -rf "${dist:?}/$name"
    install -D -s -m 755 "$program" "$dist/$name/bin/etendue"
    install -D -m 644 -t "$dist/$name/lib/etendue" "$dist"/lib/*
    install -D -m 644 -t "$dist/$name" README.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE \
        "$dist/THIRD-PARTY-NOTICES.txt"
    cp -R scenes schema "$dist/share" "$dist/$name/"
    tar -C "$dist" -czf "$dist/$name.tar.gz" "$name"
    rm -rf "${dist:?}/$name"
}

build_package() {
    command -v cargo-deb >/dev/null || cargo install cargo-deb --version '^3' --locked --root out/tools
    cargo-deb -p etendue-cli --no-build --profile "$profile" --output "$dist/"
}

build_wheel() {
    AUDITWHEEL=repair scripts/python.sh
    cp out/python/wheels/*.whl "$dist/"
}

build() {
    # For a trial the dependencies as the whole workspace has built them.
    local parts=(-p etendue-cli)
    [ "$profile" != dev ] || parts+=(-p etendue-dependencies)
    cargo build --profile "$profile" --locked "${parts[@]}"
    rm -rf "$dist"
    bundle_libraries
    write_notices
    scripts/share.sh "$program" "$dist/share"
    build_tarball
    build_package
    build_wheel
    rm -rf "${dist:?}/lib" "${dist:?}/share" "${dist:?}/THIRD-PARTY-NOTICES.txt"
    ls -lh "$dist"
}

# in_namespace SCRIPT ARGUMENT...: as root, where mounts are private; paths arrive as arguments.
in_namespace() {
    as_root unshare --mount --propagation private bash -euc "$1" in_namespace "${@:2}"
}

# try_in SUITE: unpacks a bare root with Python and numpy, and runs each of the three in it.
try_in() {
    local root=target/dist-$1
    echo "Trying them in a bare Debian root ($1), by debootstrap."
    as_root rm -rf "$root"
    mkdir -p "$root"
    # By way of /mnt, because debootstrap cannot live with a space in the path.
    # shellcheck disable=SC2016
    in_namespace '
        mount --bind "$1" /mnt
        debootstrap --variant=minbase --include=python3-numpy "$2" /mnt >/mnt/debootstrap.log || {
            tail -5 /mnt/debootstrap.log
            exit 1
        }
        mkdir -p /mnt/dist
        mount --bind -o ro "$3" /mnt/dist
        for system in proc sys dev; do mount --rbind "/$system" "/mnt/$system"; done
        exec chroot /mnt env -i LANG=C.UTF-8 PATH=/usr/sbin:/usr/bin:/sbin:/bin sh -euc "$4"
    ' "$PWD/$root" "$1" "$PWD/$dist" '
        if command -v cc || ls /usr/lib/*/libembree* 2>/dev/null; then
            echo "this root is not bare"
            exit 1
        fi
        cd /tmp
        echo "- the tarball"
        tar -xzf /dist/etendue-*.tar.gz
        mv etendue-* tarball
        tarball/bin/etendue --version
        tarball/bin/etendue render tarball/scenes/cube.json -o tar-out -q >/dev/null
        test -s tar-out/layers.exr
        echo "- the Debian package"
        dpkg -i /dist/etendue_*.deb >/dev/null
        etendue --version
        etendue render tarball/scenes/cube.json -o deb-out -q >/dev/null
        cmp tar-out/distance.npy deb-out/distance.npy
        dpkg -r etendue >/dev/null
        echo "- the wheel"
        python3 -m zipfile -e /dist/*.whl wheel
        PYTHONPATH=wheel python3 -c "
import numpy, etendue
shot = etendue.load(\"tarball/scenes/cube.json\").render()
assert (shot[\"distance\"] == numpy.load(\"tar-out/distance.npy\")).all()
accel = etendue.Accel([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
print(accel)
assert accel.closest([[0.25, 0.25, 1]], [[0, 0, -1]]).t[0] == 1
"
    '
    as_root rm -rf "$root"
}

try_all() {
    may_be_root || {
        echo "Not tried: making a Debian root and entering it takes root, or sudo." >&2
        exit 1
    }
    command -v debootstrap >/dev/null || install_packages debootstrap
    for suite in bookworm trixie; do
        try_in "$suite"
    done
    echo "All three ran in bare Debian 12 and 13 roots."
}

case "${1:-all}" in
build) build ;;
try) try_all ;;
all)
    build
    try_all
    ;;
*)
    echo "usage: scripts/dist.sh [build|try]" >&2
    exit 2
    ;;
esac

#!/usr/bin/env bash
# All that a release is made of, short of publishing it: the crates as crates.io would take them, each built from its own
# package (cargo publish --dry-run); tarball, .deb and wheel, tried in bare roots of Debian 12 and 13 (scripts/dist.sh); the
# wheel of the pure-Rust renderer for older systems (scripts/portable-wheel.sh); and what PyPI asks of wheels.
# release.sh crates|artefacts|portable|wheels does a part of it. NO_VERIFY=1 packs the crates without building them.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

step() {
    printf '\n==> %s\n' "$1"
}

# Crates and wheels say the same of where the project lives.
addresses() {
    local crates wheels
    crates=$(sed -n 's/^repository = "\(.*\)"/\1/p' Cargo.toml)
    wheels=$(sed -n 's/^Repository = "\(.*\)"/\1/p' crates/python/pyproject.toml)
    [ "$crates" = "$wheels" ] || {
        echo "Cargo.toml's repository is $crates, crates/python/pyproject.toml's Repository $wheels: make them one" >&2
        exit 1
    }
    case "$crates" in
    *example.org*) echo "note: $crates is a placeholder; give both files the project's address before publishing" ;;
    esac
}

# Packages in the order in which they would be published, and what crates.io would refuse of any.
crates() {
    step "crates"
    local arguments=(--workspace --locked --allow-dirty) private
    rm -f target/package/*.crate
    # Tools of this checkout, and the core of the wheel, are no crates for others.
    for private in benches dependencies fuzz stability python; do arguments+=(--exclude "etendue-$private"); done
    # All are built in one folder, so that what they take from elsewhere is compiled once.
    [ -n "${NO_VERIFY:-}" ] || CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target} cargo publish "${arguments[@]}" --dry-run
    # Publishing leaves no packages to look into.
    cargo package "${arguments[@]}" --no-verify
    # What is in each, and that nobody else's terms are missing.
    local packed names file
    for packed in target/package/*.crate; do
        names=$(tar -tzf "$packed")
        for file in README.md LICENSE-MIT LICENSE-APACHE; do
            [[ "$names" == *"/$file"* ]] || {
                echo "$packed has no $file" >&2
                exit 1
            }
        done
    done
    echo "$(ls target/package/*.crate | wc -l) crates in target/package, each with its README and both licences"
}

# What PyPI asks of every wheel: readable metadata, and an extension that keeps to the stable ABI it names.
wheels() {
    step "wheels"
    local tools=out/release-venv
    [ -x "$tools/bin/pip" ] || python3 -m venv "$tools"
    "$tools/bin/pip" install --quiet --disable-pip-version-check 'abi3audit>=0.0.26' 'twine>=6'
    "$tools/bin/twine" check --strict out/dist/*.whl
    "$tools/bin/abi3audit" --strict --summary out/dist/*.whl
    local wheel names file
    for wheel in out/dist/*.whl; do
        names=$(python3 -m zipfile -l "$wheel")
        for file in LICENSE-MIT LICENSE-APACHE THIRD-PARTY-NOTICES.txt; do
            [[ "$names" == *"$file"* ]] || {
                echo "$wheel has no $file" >&2
                exit 1
            }
        done
        # PyPI's and the project's own limit.
        if [ "$(stat -c %s "$wheel")" -gt $((40 << 20)) ]; then
            echo "$wheel is larger than 40 MB" >&2
            exit 1
        fi
    done
}

addresses
case "${1:-all}" in
crates) crates ;;
artefacts) scripts/dist.sh ;;
portable) scripts/portable-wheel.sh ;;
wheels) wheels ;;
all)
    crates
    scripts/dist.sh
    scripts/portable-wheel.sh
    wheels
    ;;
*)
    echo "usage: scripts/release.sh [crates|artefacts|portable|wheels]" >&2
    exit 2
    ;;
esac

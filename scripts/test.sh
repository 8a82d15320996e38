#!/usr/bin/env bash
# Everything that CI runs, cheapest first; the tests of the whole workspace and a real window close.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

step() {
    printf '\n==> %s\n' "$1"
}

# run_tests CARGO-ARGUMENT...: with nextest when it is installed, else with cargo's own runner.
run_tests() {
    if cargo nextest --version >/dev/null 2>&1; then
        cargo nextest run "$@"
    else
        cargo test --lib --bins --tests "$@"
    fi
}

# in_background NAME COMMAND...: what mostly waits for a network or for daemons goes on beside other steps.
in_background() {
    mkdir -p target/background
    "${@:2}" >"target/background/$1.log" 2>&1 &
    echo $! >"target/background/$1.pid"
}

# finish NAME: waits for it, and shows what it said.
finish() {
    local status=0
    wait "$(cat "target/background/$1.pid")" || status=$?
    cat "target/background/$1.log"
    return "$status"
}

# Snapshots of messages ask cargo for it otherwise, once a test.
export INSTA_WORKSPACE_ROOT=$PWD

trap 'kill $(jobs -p) 2>/dev/null || true' EXIT

step "format"
cargo fmt --all --check

in_background debian13 scripts/test-embree4.sh --root

if cargo deny --version >/dev/null 2>&1; then
    step "licences, sources and advisories of dependencies"
    cargo deny check bans licenses sources
    # The database of advisories is a repository of its own, which not every machine reaches.
    if timeout 120 cargo deny fetch db >/dev/null 2>&1; then
        cargo deny check --disable-fetch advisories
    else
        echo "advisories: passed over, https://github.com/RustSec/advisory-db cannot be had from here"
    fi
fi

step "lints"
cargo clippy --workspace --features etendue-cli/window --all-targets -- -D warnings

# An empty EMBREE_DIR would stop the bindings' build, so this also shows that nothing asks for them.
# With etendue-dependencies, which has no code, parts of the workspace take what the whole of it has built.
step "lints without Embree"
without_embree=(-p etendue-dependencies -p etendue-accel -p etendue -p etendue-cli --no-default-features)
EMBREE_DIR=/nonexistent cargo clippy "${without_embree[@]}" --all-targets -- -D warnings
python3 scripts/shared_builds.py

step "documentation"
# With the features of the lints and the tests, so that dependencies are built once.
RUSTDOCFLAGS="-D warnings" cargo doc --workspace --features etendue-cli/window --no-deps
cargo test --workspace --features etendue-cli/window --doc

step "crates as crates.io would take them, not built once more"
NO_VERIFY=1 scripts/release.sh crates

# What does not trace, or traces by `bvh` in the tests of the workspace, too, is not run twice.
step "tests without Embree"
elsewhere='/^(files|gallery|inputs|lamps|lens|lens_pictures|lens_reference|light_fields|many_renders|memory|models|openings_and_glasses|shards|stopping|waves)(::|_)/'
if cargo nextest --version >/dev/null 2>&1; then
    without_embree+=(-E "not test($elsewhere)")
fi
EMBREE_DIR=/nonexistent run_tests "${without_embree[@]}"

step "tests against Embree 4"
finish debian13
scripts/test-embree4.sh --library

# The command that the tests of the workspace leave serves all that follows.
step "building the tests"
run_tests --workspace --features etendue-cli/window --no-run
export ETENDUE=target/debug/etendue

in_background slurm scripts/test-slurm.sh
PROFILE=dev in_background python scripts/python.sh

step "light fields: the page, and another decoder's opinion"
IMAGES=target/light-field-images scripts/light-fields.sh --samples 32 --quiet

step "Python package"
finish python

step "jobs on Slurm"
finish slurm

step "window"
scripts/window.sh x11 wayland

step "Open Image Denoise, for the tests that denoise"
ETENDUE_OIDN=$(scripts/oidn.sh)
export ETENDUE_OIDN

step "tests"
run_tests --workspace --features etendue-cli/window

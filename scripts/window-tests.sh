# What both tests of a real window share; to be sourced, with the name of the test as NAME. It leaves `etendue`, the
# command with the window; `shots`, a folder that stays; `home`, one that goes; and `pids`, which are ended with it.
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# ETENDUE names a command with the window that is built already, as the workspace's tests leave one.
[ -n "${ETENDUE:-}" ] || cargo build -p etendue-cli --features window
etendue=$(realpath "${ETENDUE:-target/debug/etendue}")
shots=$PWD/out/window
home=$(mktemp -d)
mkdir -p "$shots"

pids=()
finish() {
    for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
    wait "${pids[@]}" 2>/dev/null || true
    rm -rf "$home"
}
trap finish EXIT

# fail MESSAGE: ends the test, with what the window said.
fail() {
    echo "$NAME: $1" >&2
    import -window root "$shots/failed.png" 2>/dev/null || true
    cat "$home/said" "$home"/*.log >&2 2>/dev/null || true
    rm -rf "$shots/failed" && cp -r "$home" "$shots/failed"
    exit 1
}

# until_so SECONDS COMMAND...: waits until the command succeeds.
until_so() {
    local end=$((SECONDS + $1))
    while ! "${@:2}" >/dev/null 2>&1; do
        [ "$SECONDS" -lt "$end" ] || return 1
        sleep 0.2
    done
}

# same_files: what the window rendered into $home/shown is what the command line rendered into $home/saved, to the bit.
same_files() {
    local file
    # The manifest is written last.
    until_so 60 test -s "$home/shown/etendue-manifest.json" || fail "nothing was rendered into a folder"
    for file in picture.png depth.npy normal.npy layers.exr; do
        cmp "$home/saved/$file" "$home/shown/$file" || fail "$file of the window and of the command line differ"
    done
}

# has_ended PID: waits until a window has closed, to the exit code 0.
has_ended() {
    until_so 60 bash -c "! kill -0 $1" || fail "the window does not close"
    wait "$1" || fail "the window ends with $?"
}

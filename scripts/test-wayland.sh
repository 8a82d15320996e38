#!/usr/bin/env bash
# A real window on Wayland, without any X server: a compositor in memory (sway) shows it, and keys drive it. What it
# renders is what the command line renders, to the bit. A screenshot is left in out/window.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# ETENDUE names a command with the window that is built already, as the workspace's tests leave one.
[ -n "${ETENDUE:-}" ] || cargo build -p etendue-cli --features window
etendue=$(realpath "${ETENDUE:-target/debug/etendue}")
shots=$PWD/out/window
home=$(mktemp -d)
mkdir -p "$shots" "$home/run"

pids=()
finish() {
    for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
    wait "${pids[@]}" 2>/dev/null || true
    rm -rf "$home"
}
trap finish EXIT

fail() {
    echo "test-wayland: $1" >&2
    cat "$home/said" "$home/sway.log" >&2 2>/dev/null || true
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

has_socket() {
    compgen -G "$home/run/wayland-[0-9]" && compgen -G "$home/run/sway-ipc.*"
}

# sway refuses to be root; its sockets are another user's then.
as=()
if [ "$(id -u)" -eq 0 ]; then
    as=(setpriv --reuid=65534 --regid=65534 --clear-groups)
    chown 65534:65534 "$home" "$home/run"
fi
chmod 700 "$home/run"
printf '%s\n' 'output HEADLESS-1 resolution 1360x860' 'default_border none' 'xwayland disable' >"$home/config"
unset DISPLAY WAYLAND_DISPLAY
export XDG_RUNTIME_DIR=$home/run LIBGL_ALWAYS_SOFTWARE=1
WLR_BACKENDS=headless WLR_RENDERER=pixman WLR_LIBINPUT_NO_DEVICES=1 HOME=$home \
    "${as[@]}" sway -c "$home/config" 2>"$home/sway.log" &
pids+=($!)
until_so 30 has_socket || fail "sway does not start"
WAYLAND_DISPLAY=$(basename "$(compgen -G "$home/run/wayland-[0-9]")")
SWAYSOCK=$(compgen -G "$home/run/sway-ipc.*")
export WAYLAND_DISPLAY SWAYSOCK

title_is() {
    swaymsg -t get_tree | jq -e --arg title "$1" 'any(.. | objects; .name? == $title and .app_id? == "etendue")'
}

jq '.camera.sensor.resolution = [240, 160]' <scenes/first-light.json |
    jq '.objects[0].triangles = 20000' >"$home/small.json"
"$etendue" view "$home/small.json" 2>"$home/said" &
pid=$!
pids+=("$pid")
until_so 120 title_is "small.json - etendue" || fail "the window never has a whole picture"

# keys NAME WORDS...: a shortcut with Ctrl, and a path for what it asks. wtype plugs in a keyboard, which the window
# takes a moment to know.
keys() {
    wtype -s 1000 -M ctrl -k "$1" -m ctrl -s 500 -M ctrl -k a -m ctrl -s 300 "$2" -s 300 -k Return -s 300
}

keys r "$home/shown"
# The manifest is written last.
until_so 60 test -s "$home/shown/etendue-manifest.json" || fail "nothing was rendered into a folder"
"$etendue" render "$home/small.json" -o "$home/saved" --quiet >/dev/null
for file in picture.png depth.npy normal.npy layers.exr; do
    cmp "$home/saved/$file" "$home/shown/$file" || fail "$file of the window and of the command line differ"
done
cp "$home/small.json" "$home/other.json"
keys o "$home/other.json"
until_so 60 title_is "other.json - etendue" || fail "the other scene is not opened"
grim "$shots/wayland.png"
[ "$(identify -format %k "$shots/wayland.png")" -gt 500 ] || fail "there is no picture in $shots/wayland.png"
wtype -s 1000 -M ctrl -k q -m ctrl -s 300
until_so 60 bash -c "! kill -0 $pid" || fail "the window does not close"
wait "$pid" || fail "the window ends with $?"
echo "the window works on Wayland; the screenshot is $shots/wayland.png"

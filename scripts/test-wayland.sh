#!/usr/bin/env bash
# A real window on Wayland, without any X server: a compositor in memory (sway) shows it, and keys drive it. What it
# renders is what the command line renders, to the bit. A screenshot is left in out/window.
set -euo pipefail
NAME=test-wayland
. "$(dirname "${BASH_SOURCE[0]}")/window-tests.sh"

mkdir "$home/run"

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
"$etendue" render "$home/small.json" -o "$home/saved" --quiet >/dev/null
same_files
cp "$home/small.json" "$home/other.json"
keys o "$home/other.json"
until_so 60 title_is "other.json - etendue" || fail "the other scene is not opened"
grim "$shots/wayland.png"
[ "$(identify -format %k "$shots/wayland.png")" -gt 500 ] || fail "there is no picture in $shots/wayland.png"
wtype -s 1000 -M ctrl -k q -m ctrl -s 300
has_ended "$pid"
echo "the window works on Wayland; the screenshot is $shots/wayland.png"

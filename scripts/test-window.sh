#!/usr/bin/env bash
# A real window on a screen in memory, driven by keys and the mouse: opened, moved about in, saved, given a
# broken file, closed during a render. What is saved must render to the same bits. Screenshots are left in
# out/window, at once and twice the size, dark and light. docs/images/window.png is lens-1x.png of
# RESOLUTION=[480,320] SAMPLES=32.
set -euo pipefail
NAME=test-window
. "$(dirname "${BASH_SOURCE[0]}")/window-tests.sh"

# Without a display it is said what to do, and the exit code is 2.
code=0
(unset DISPLAY WAYLAND_DISPLAY && "$etendue" view scenes/first-light.json 2>"$home/said") || code=$?
[ "$code" -eq 2 ] || fail "without a display the exit code is $code instead of 2"
grep -q "ssh -X" "$home/said" || fail "without a display it does not say what to do"

. "$(dirname "${BASH_SOURCE[0]}")/window-x11.sh"

cp -r scenes/double-gauss.json scenes/lenses "$home/"
scene=$home/double-gauss.json
jq ".camera.sensor.resolution = ${RESOLUTION:-[240,160]} | .render.samples = ${SAMPLES:-4}" <"$scene" \
    >"$home/small.json"
scene=$home/small.json

open 1 "$scene"
shoot dark-1x
press ctrl+t
sleep 1
shoot light-1x
press ctrl+t

# A pixel, its values and its rays through the lens.
xdotool mousemove 640 330 sleep 0.2 click 1 sleep 1 mousemove 578 12 sleep 0.2 click 1 sleep 1 mousemove 640 700
until_so 60 is_idle || fail "the panel of the lens never settles"
shoot lens-1x
cmp -s "$shots/dark-1x.png" "$shots/lens-1x.png" && fail "the panel of the lens does not open"
xdotool mousemove 578 12 sleep 0.2 click 1 sleep 1
until_so 60 is_idle

# A drag in the picture turns the camera; saved, it is another scene.
xdotool mousemove 640 430 sleep 0.2 mousedown 1 sleep 0.2 mousemove_relative 30 5 sleep 0.2 \
    mousemove_relative 40 10 sleep 0.2 mousemove_relative 30 5 sleep 0.2 mouseup 1 sleep 0.5
shows "small.json*" || fail "the drag changed nothing"
shoot turned-1x
cmp -s "$shots/dark-1x.png" "$shots/turned-1x.png" && fail "the drag changed nothing"
press ctrl+s
shows small.json || fail "Ctrl+S saved nothing"
jq -e '.camera.pose.from != [0, 0.5, 1.9]' "$scene" >/dev/null || fail "the camera did not move"
"$etendue" render "$scene" -o "$home/saved" --quiet >/dev/null

# The window writes what the command line does.
press ctrl+r
xdotool key ctrl+a
xdotool type "$home/shown"
press Return
same_files

# A broken file is told, and changes nothing.
echo '{ "etendue": 1, "camera": ' >"$home/broken.json"
press ctrl+o
sleep 0.5
shoot asking-1x
xdotool key ctrl+a
xdotool type "$home/broken.json"
press Return
until_so 60 is_idle
shoot broken-1x
kill -0 "$pid" || fail "a broken file ends the window"
spent=$(ticks)
sleep 5
idle=$(($(ticks) - spent))
echo "processor time of a window at rest over 5 s: ${idle}0 ms"
[ "$idle" -le 50 ] || fail "a window at rest works"
close_window

# Closed in the middle of a render that would take hours.
jq '.tracer = {"type": "path"} | .render.samples = 1000000' <"$scene" >"$home/slow.json"
WINIT_X11_SCALE_FACTOR=1 "$etendue" view "$home/slow.json" 2>"$home/said" &
pid=$!
pids+=("$pid")
until_so 60 xdotool search --onlyvisible --name 'etendue$' || fail "there is no window on the slow scene"
window=$(xdotool search --onlyvisible --name 'etendue$' | tail -n 1)
xdotool windowfocus "$window"
sleep 2
close_window

open 2 "$scene"
shoot dark-2x
press ctrl+t
sleep 1
shoot light-2x
close_window
echo "the window works; screenshots are in $shots"

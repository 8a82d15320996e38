#!/usr/bin/env bash
# Six states of the window, each reached as a user reaches it and left by what it offers: a first start, a broken file,
# a heavy one, a picture's layers, a section that is removed, a sensor's image with the plan. Screenshots are left in
# out/window as state-*.png; `make docs-window` puts them where docs/reference/window.md shows them.
set -euo pipefail
NAME=window-states
. "$(dirname "${BASH_SOURCE[0]}")/window-tests.sh"
. "$PWD/scripts/window-x11.sh"

# Files are named as a user names them, beside which the window was started: its pictures show no other folder.
cp -r scenes/double-gauss.json scenes/lenses "$home/"
cd "$home"

# click X Y: the left button at a place of the window, and what follows from it drawn.
click() {
    hover "$1" "$2"
    xdotool click 1
    sleep 0.3
    until_so 60 is_idle || fail "the window never settles behind a click"
}

hover() {
    xdotool mousemove "$1" "$2"
    sleep 0.3
    until_so 60 is_idle || fail "the window never settles under the mouse"
}

# shot STATE: its screenshot, as the window is now.
shot() {
    import -window "$window" "$shots/state-$1.png"
}

# keep STATE: its screenshot, when nothing in it changes any more: panels take some frames to find their widths.
keep() {
    is_still() {
        shot "$1"
        sleep 1
        import -window "$window" "$home/again.png"
        [ "$(compare -metric AE "$shots/state-$1.png" "$home/again.png" null: 2>&1)" = 0 ]
    }
    until_so 60 is_still "$1" || fail "state $1 never stands still"
}

# differ STATE STATE: fails where the screenshots of two states are the same picture.
differ() {
    ! cmp -s "$shots/state-$1.png" "$shots/state-$2.png" || fail "state $2 looks like state $1"
}

# A first start: no file, scenes to begin with.
start 1
until_so 60 is_idle || fail "the window without a file works"
until_so 30 title_is etendue || fail "the window without a file is called otherwise"
keep start
# The third of them is one with a sensor.
click 680 440
shows sensor.json || fail "the first start does not begin a scene"

# Its sensor's image, with the decisions of the plan.
click 380 11
click 380 56
shows sensor.json || fail "the sensor's image is not shown"
hover 40 240
keep closed
click 40 240
keep sensor
differ start sensor
differ closed sensor
close_window

# A broken file: the message of the command line, with the place.
printf '%s\n' '{' '  "etendue": 1,' '  "camera": { "type": "pinhole", "fov": 200 },' \
    '  "objects": [{ "shape": "sphere" }]' '}' >broken.json
start 1 broken.json
# Errors alone are of this red.
is_red() {
    shot broken
    [ "$(convert "$shots/state-broken.png" -fill black +opaque '#ff0000' -format '%[fx:mean*w*h]' info:)" != 0 ]
}
until_so 60 is_red || fail "a broken file is not told"
close_window

# A heavy file: what is done of it, and a way to leave it.
blob='{"shape": "blob", "triangles": 4000000}'
echo '{"etendue": 1, "tracer": {"type": "facing"}, "objects": ['"$(printf "$blob, %.0s" {1..15})$blob"']}' >heavy.json
start 1 heavy.json
until_so 120 title_is "heavy.json (rendering) - etendue" || fail "a heavy file is not being read"
# The bar stands in the middle, and has come this far along it.
has_bar() {
    shot heavy
    [ "$(convert "$shots/state-heavy.png" -format '%[fx:p{560,302}.b > 0.3]' info:)" = 1 ]
}
until_so 180 has_bar || fail "what is done of a heavy file is not shown"
xdotool mousemove 640 324 sleep 0.3 click 1
until_so 60 is_idle || fail "a heavy file is not left"
keep left
differ heavy left
close_window

# A picture with layers, and the menu of them.
jq ".camera.sensor.resolution = ${RESOLUTION:-[240,160]} | .render.samples = ${SAMPLES:-4}" \
    <double-gauss.json >lens.json
open 1 lens.json
keep whole
click 380 11
keep layers
differ whole layers
press Escape
until_so 60 is_idle

# The button that removes a section names it, and removes it.
hover 1080 222
keep remove
xdotool click 1
# The picture is larger now, and nothing waits for it.
is_changed() {
    [[ $(xdotool getwindowname "$window") == lens.json\** ]]
}
until_so 60 is_changed || fail "nothing was removed"
press ctrl+s
is_saved() {
    jq -e '.camera | has("sensor") | not' lens.json
}
until_so 60 is_saved || fail "the sensor is still there"
close_window
echo "the window reaches its states; screenshots are in $shots"

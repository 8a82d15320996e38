#!/usr/bin/env bash
# window.sh [TEST...]: real windows on screens in memory, driven by keys and the mouse; all tests where none is named.
# Screenshots are left in out/window.
#   x11      opened, moved about in, saved, given a broken file, closed during a render. What is saved must render to the
#            same bits. Screenshots at once and twice the size, dark and light. docs/images/window.png is lens-1x.png of
#            RESOLUTION=[480,320] SAMPLES=32.
#   states   six states, each reached as a user reaches it and left by what it offers: a first start, a broken file,
#            a heavy one, a picture's layers, a section that is removed, a sensor's image with the plan. Screenshots are
#            state-*.png; `make docs-window` puts them where docs/reference/window.md shows them.
#   wayland  without any X server: a compositor in memory (sway) shows the window, and keys drive it. What it renders is
#            what the command line renders, to the bit.
# ETENDUE names a command with the window that is built already, as the workspace's tests leave one.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

[ -n "${ETENDUE:-}" ] || cargo build -p etendue-cli --features window
etendue=$(realpath "${ETENDUE:-target/debug/etendue}")
shots=$PWD/out/window
mkdir -p "$shots"

# begin NAME: `home`, a folder, and `pids`, processes, both of which end with the test.
begin() {
    name=$1
    home=$(mktemp -d)
    pids=()
    trap finish EXIT
}

finish() {
    for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
    wait "${pids[@]}" 2>/dev/null || true
    rm -rf "$home"
}

# fail MESSAGE: ends the test, with what the window said.
fail() {
    echo "window.sh $name: $1" >&2
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

# begin_screen: a screen in memory, under X, whose number Xvfb writes when it is there.
begin_screen() {
    Xvfb -displayfd 3 -screen 0 2800x1800x24 +extension GLX -nolisten tcp 3>"$home/display" 2>/dev/null &
    pids+=($!)
    until_so 30 test -s "$home/display" || fail "Xvfb does not start"
    DISPLAY=:$(cat "$home/display")
    export DISPLAY LIBGL_ALWAYS_SOFTWARE=1
}

# start SCALE [FILE]: a window, on a file; sets `window` and `pid`.
start() {
    WINIT_X11_SCALE_FACTOR=$1 "$etendue" view "${@:2}" 2>"$home/said" &
    pid=$!
    pids+=("$pid")
    until_so 60 xdotool search --onlyvisible --name 'etendue$' || fail "there is no window on ${2:-nothing}"
    window=$(xdotool search --onlyvisible --name 'etendue$' | tail -n 1)
    xdotool windowmove "$window" 0 0 windowfocus "$window"
}

# open SCALE FILE: the same, until it has a whole picture.
open() {
    start "$@"
    shows "$(basename "$2")" || fail "the window on $2 never has a whole picture"
}

# shows NAME: waits for a whole picture of a file, whose name has a star when it is not saved.
shows() {
    until_so 120 title_is "$1 - etendue" && sleep 0.5
}

title_is() {
    [ "$(xdotool getwindowname "$window")" = "$1" ]
}

# ticks: processor time of the window so far, in hundredths of a second.
ticks() {
    awk '{print $14 + $15}' "/proc/$pid/stat"
}

# is_idle: succeeds where next to nothing was done for a while. A loop that spins takes sixty.
is_idle() {
    local before
    before=$(ticks)
    sleep 0.6
    [ $(($(ticks) - before)) -le 6 ]
}

# shoot NAME: a screenshot with more colours than an empty window has.
shoot() {
    import -window "$window" "$shots/$1.png"
    [ "$(identify -format %k "$shots/$1.png")" -gt 500 ] || fail "there is no picture in $shots/$1.png"
}

press() {
    xdotool key --clearmodifiers "$1"
    sleep 0.3
}

# close_window: by its own shortcut, to the exit code 0.
close_window() {
    press ctrl+q
    has_ended "$pid"
}

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

test_x11() {
    # Without a display it is said what to do, and the exit code is 2.
    code=0
    (unset DISPLAY WAYLAND_DISPLAY && "$etendue" view scenes/first-light.json 2>"$home/said") || code=$?
    [ "$code" -eq 2 ] || fail "without a display the exit code is $code instead of 2"
    grep -q "ssh -X" "$home/said" || fail "without a display it does not say what to do"

    begin_screen

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
}

test_states() {
    begin_screen

    # Files are named as a user names them, beside which the window was started: its pictures show no other folder.
    cp -r scenes/double-gauss.json scenes/lenses "$home/"
    cd "$home"

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
}

test_wayland() {
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
}

[ $# -gt 0 ] || set -- x11 states wayland
for test in "$@"; do
    # In a shell of its own: each has its folder, its processes and its screen.
    (
        begin "$test"
        "test_$test"
    )
done

# What tests of a real window under X share, on a screen in memory; to be sourced behind window-tests.sh.
# A screen of its own; its number is told when it is there.
Xvfb -displayfd 3 -screen 0 2800x1800x24 +extension GLX -nolisten tcp 3>"$home/display" 2>/dev/null &
pids+=($!)
until_so 30 test -s "$home/display" || fail "Xvfb does not start"
DISPLAY=:$(cat "$home/display")
export DISPLAY LIBGL_ALWAYS_SOFTWARE=1

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

# Whether next to nothing was done for a while. A loop that spins takes sixty.
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

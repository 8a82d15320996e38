# Sourced by the other scripts: Debian packages, and the right to install them.
# shellcheck shell=bash

# need REASON PACKAGE...: notes the packages in `missing`, and says why.
missing=()
need() {
    echo "missing: ${*:2} ($1)"
    missing+=("${@:2}")
}

# Runs a command as root: directly, or through sudo when that is there and may ask for a password.
as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    elif may_sudo; then
        sudo "$@"
    else
        return 1
    fi
}

may_sudo() {
    command -v sudo >/dev/null && { sudo -n true 2>/dev/null || [ -t 0 ]; }
}

may_be_root() {
    [ "$(id -u)" -eq 0 ] || may_sudo
}

# install_packages PACKAGE...: with apt, or else the line to run by hand, and failure.
install_packages() {
    local by_hand="apt-get update && apt-get install --no-install-recommends $*"
    if ! command -v apt-get >/dev/null; then
        echo "This is not Debian: install what $* give there, with your system's own means." >&2
        return 1
    fi
    if may_be_root && echo "Installing with apt: $*" && as_root apt-get update -q &&
        as_root env DEBIAN_FRONTEND=noninteractive \
            apt-get install -qy --no-install-recommends -o DPkg::Lock::Timeout=300 "$@"; then
        return
    fi
    echo "Could not install them from here. As root, run:  $by_hand" >&2
    return 1
}

#!/usr/bin/env bash
# bench-peers.sh SCRIPT [ARGUMENT...]: other programs at the same job, by one of the scripts in benches/,
# which takes the arguments. What is missing for them is installed or, where that cannot be, said.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/packages.sh
. scripts/packages.sh

script=$1

has_library() {
    ldconfig -p | grep -q "$1"
}

need_open3d() {
    has_library libusb-1.0.so.0 || need "Open3D loads it" libusb-1.0-0
    has_library libGL.so.1 || need "Open3D loads it" libgl1
    has_library libX11.so.6 || need "Open3D loads it" libx11-6
    has_library libgomp.so.1 || need "Open3D loads it" libgomp1
}

need_mitsuba() {
    # 15, which Debian 12 has by itself, aborts.
    has_library libLLVM.so.19 || need "Mitsuba's variant for processors compiles with it" libllvm19
}

need_blender() {
    has_library libX11.so.6 || need "Blender loads it" libx11-6
    has_library libXrender.so.1 || need "Blender loads it" libxrender1
    has_library libXfixes.so.3 || need "Blender loads it" libxfixes3
    has_library libXi.so.6 || need "Blender loads it" libxi6
    has_library libxkbcommon.so.0 || need "Blender loads it" libxkbcommon0
    has_library libSM.so.6 || need "Blender loads it" libsm6
    has_library libGL.so.1 || need "Blender loads it" libgl1
}

PATH=$PATH:/usr/sbin:/sbin
python3 -c "import ensurepip, venv" 2>/dev/null || need "for the programs' own folder" python3-venv
case $script in
peers.py) need_open3d && need_mitsuba ;;
light_peers.py | light_agreement.py) need_mitsuba ;;
cycles_peers.py) need_blender ;;
python_peers.py) need_open3d ;;
esac
# Without them the programs that want them are left out, by name.
[ ${#missing[@]} -eq 0 ] || install_packages "${missing[@]}" || true

# Where Debian has the library without the name that Mitsuba looks for.
for library in /usr/lib/*/libLLVM.so.19.1; do
    [ ! -e "$library" ] || export DRJIT_LIBLLVM_PATH="${DRJIT_LIBLLVM_PATH:-$library}"
done
python3 "benches/$script" "${@:2}"

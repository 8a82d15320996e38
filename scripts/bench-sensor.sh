#!/usr/bin/env bash
# bench-sensor.sh: one exposure by etendue, numpy, prysm and emva1288 side by side, the Python ones in
# an environment of their own below the target folder.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

target=${CARGO_TARGET_DIR:-target}
peers=$target/sensor-peers
if [ ! -e "$peers/ready" ]; then
    echo "installing numpy, prysm and emva1288 from PyPI into $peers" >&2
    python3 -m venv --clear "$peers"
    "$peers/bin/python" -m pip install --quiet 'numpy<2' prysm==0.21.1 emva1288==1.0.2
    touch "$peers/ready"
fi
cargo build --release -p etendue-sensor --example expose_frame
# One thread against one thread.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
"$peers/bin/python" benches/sensor_peers.py "$target/release/examples/expose_frame"

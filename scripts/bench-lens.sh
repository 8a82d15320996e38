#!/usr/bin/env bash
# bench-lens.sh: rays through the double Gauss by etendue and by optiland (numpy) side by side, the
# latter in an environment of its own below the target folder; writes its section of docs/lenses.md.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

target=${CARGO_TARGET_DIR:-target}
peers=$target/lens-peers
if [ ! -e "$peers/ready" ]; then
    echo "installing optiland from PyPI into $peers" >&2
    python3 -m venv --clear "$peers"
    "$peers/bin/python" -m pip install --quiet optiland==0.6.3
    touch "$peers/ready"
fi
cargo build --release -p etendue-camera --example trace_lens
# One thread against one thread.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
"$peers/bin/python" benches/lens_peers.py "$target/release/examples/trace_lens" \
    scenes/lenses/double-gauss.json

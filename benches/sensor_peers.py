"""Exposes the same frame with etendue and with Python's ways to do it, one thread each.

sensor_peers.py EXPOSE_FRAME: the path of etendue-sensor's example of that name. Every program gets
the same mean electrons (a ramp over the columns), 2.5 e- of read noise, 12 bits; the least time of
several frames counts.
"""

import json
import subprocess
import sys
import time

import numpy as np

COLUMNS, ROWS = 2736, 1824
ELECTRONS = 16000.0
READ_NOISE = 2.5
TIMES = 5


def least(frame):
    best = float("inf")
    for _ in range(TIMES):
        start = time.perf_counter()
        frame()
        best = min(best, time.perf_counter() - start)
    return best


def plain_numpy(mean, draw):
    def frame():
        electrons = draw(mean) + rng.normal(0.0, READ_NOISE, mean.shape)
        counts = np.rint(electrons * (4095 / ELECTRONS))
        return np.clip(counts, 0, 4095).astype(np.uint16)

    rng = np.random.default_rng(0)
    return frame


def prysm_detector(mean):
    from prysm.detector import Detector

    detector = Detector(
        dark_current=1, read_noise=READ_NOISE, bias=0, fwc=ELECTRONS,
        conversion_gain=ELECTRONS / 4095, bits=12, exposure_time=0.01,
    )
    light = mean / 0.01
    return lambda: detector.expose(light)


def emva_camera(mean):
    from emva1288.camera.camera import Camera

    camera = Camera(
        bit_depth=12, width=COLUMNS, height=ROWS, K=4095 / ELECTRONS, K_min=0.01,
        dark_signal_0=0.0, sigma2_dark_0=READ_NOISE**2, u_esat=ELECTRONS,
    )
    # The same electrons by way of its own radiance, which it integrates anew for each frame.
    unit = camera._u_e(np.ones((ROWS, COLUMNS, 1)))
    radiance = (mean / unit)[:, :, np.newaxis]
    return lambda: camera.grab(radiance)


def main():
    ours = subprocess.run(
        [sys.argv[1], str(COLUMNS), str(ROWS), str(int(ELECTRONS)), str(TIMES)],
        check=True, capture_output=True, text=True,
    )
    ours = json.loads(ours.stdout)
    ramp = np.linspace(0.0, ELECTRONS, COLUMNS, endpoint=False)
    mean = np.ascontiguousarray(np.broadcast_to(ramp, (ROWS, COLUMNS)))
    rng = np.random.default_rng(1)
    rows = [("etendue, exact Poisson", ours["poisson"]), ("etendue, normal", ours["normal"])]
    for name, make in [
        ("numpy, Poisson", lambda: plain_numpy(mean, rng.poisson)),
        ("numpy, normal", lambda: plain_numpy(mean, lambda m: rng.normal(m, np.sqrt(m)))),
        ("prysm.detector 0.21.1", lambda: prysm_detector(mean)),
        ("emva1288 1.0.2 Camera", lambda: emva_camera(mean)),
    ]:
        try:
            rows.append((name, least(make())))
        except Exception as error:
            print(f"{name} is left out: {type(error).__name__}: {error}", file=sys.stderr)
    print(f"{COLUMNS} x {ROWS} pixels, 0 to {ELECTRONS:.0f} electrons, one thread\n")
    print("| program | s | Mpixel/s | times etendue's |")
    print("|---|---|---|---|")
    for name, seconds in rows:
        rate = COLUMNS * ROWS / seconds / 1e6
        print(f"| {name} | {seconds:.3f} | {rate:.1f} | {seconds / ours['poisson']:.1f} |")


if __name__ == "__main__":
    main()

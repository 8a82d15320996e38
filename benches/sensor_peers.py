#!/usr/bin/env python3
"""Exposes frames with etendue, exactly and by the normal approximation, and the same frame with Python's
ways to do it, one thread each; writes the section of docs/measurements/sensors.md on it.

    python3 benches/sensor_peers.py [--rounds N] [--output docs/measurements/sensors.md]

Every program gets the same mean electrons (a ramp over the columns), 2.5 e- of read noise, 12 bits.
"""

import json
import statistics
import subprocess
import sys
import time

import program
from section import machine, put, spread

COLUMNS, ROWS = 2736, 1824
ELECTRONS = 16000.0
READ_NOISE = 2.5
# A sensor of 20 megapixels.
LARGE = (5472, 3648)


def rounds_of(frame, count):
    """Seconds of every round but a first one, which touches the memory for the first time."""
    taken = []
    for _ in range(count + 1):
        start = time.perf_counter()
        frame()
        taken.append(time.perf_counter() - start)
    return taken[1:]


def plain_numpy(rng, mean, draw):
    import numpy as np

    def frame():
        electrons = draw(mean) + rng.normal(0.0, READ_NOISE, mean.shape)
        counts = np.rint(electrons * (4095 / ELECTRONS))
        return np.clip(counts, 0, 4095).astype(np.uint16)

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
    import numpy as np
    from emva1288.camera.camera import Camera

    camera = Camera(
        bit_depth=12, width=COLUMNS, height=ROWS, K=4095 / ELECTRONS, K_min=0.01,
        dark_signal_0=0.0, sigma2_dark_0=READ_NOISE**2, u_esat=ELECTRONS,
    )
    # The same electrons by way of its own radiance, which it integrates anew for each frame.
    unit = camera._u_e(np.ones((ROWS, COLUMNS, 1)))
    radiance = (mean / unit)[:, :, np.newaxis]
    return lambda: camera.grab(radiance)


def exposed(columns, rows, light, threads, rounds):
    """etendue's rounds: seconds by noise model."""
    arguments = [str(value) for value in (columns, rows, light, rounds, threads)]
    out = subprocess.run([program.built("examples/expose_frame"), *arguments], check=True,
                         capture_output=True, text=True)
    return json.loads(out.stdout)


def large_frames(rounds, text, goals):
    """The frame of 20 megapixels by light, on one thread and on two."""
    columns, rows = LARGE
    pixels = columns * rows / 1e6
    text += [
        f"{columns} x {rows} pixels, 2.5 e⁻ of read noise, 12 bits; Mpixel/s in all, and the time of the",
        "exact distribution over that of its normal approximation.",
        "",
        "| mean electrons | threads | exact Poisson | normal | exact / normal |",
        "|---|---|---|---|---|",
    ]
    for light in ["1", "10", "40", "1000", "ramp"]:
        for threads in [1, 2]:
            seconds = exposed(columns, rows, light, threads, rounds)
            rates = {name: [pixels / s for s in times] for name, times in seconds.items()}
            ratio = statistics.median(
                p / n for p, n in zip(seconds["poisson"], seconds["normal"])
            )
            name = "0 to 16 000" if light == "ramp" else light
            text.append(
                f"| {name} | {threads} | {spread(rates['poisson'])} | {spread(rates['normal'])} | "
                f"{ratio:.2f} |"
            )
            if threads == 2:
                goals.append((f"exact over normal, {name} e⁻, two threads", ratio, 2.0, False))
            elif light in ("40", "1000"):
                rate = statistics.median(rates["poisson"])
                goals.append((f"exact, {name} e⁻, Mpixel/s on one thread", rate, 40.0, True))


def side_by_side(rounds, text, goals):
    """A smaller frame by every program."""
    import numpy as np

    ours = exposed(COLUMNS, ROWS, "ramp", 1, rounds)
    ramp = np.linspace(0.0, ELECTRONS, COLUMNS, endpoint=False)
    mean = np.ascontiguousarray(np.broadcast_to(ramp, (ROWS, COLUMNS)))
    draws, noise = np.random.default_rng(1), np.random.default_rng(0)
    rows = [("etendue, exact Poisson", ours["poisson"]), ("etendue, normal", ours["normal"])]
    for name, make in [
        ("numpy, Poisson", lambda: plain_numpy(noise, mean, draws.poisson)),
        ("numpy, normal", lambda: plain_numpy(
            noise, mean, lambda m: draws.normal(m, np.sqrt(m)))),
        ("prysm.detector 0.21.1", lambda: prysm_detector(mean)),
        ("emva1288 1.0.2 Camera", lambda: emva_camera(mean)),
    ]:
        try:
            rows.append((name, rounds_of(make(), rounds)))
        except Exception as error:
            print(f"{name} is left out: {type(error).__name__}: {error}", file=sys.stderr)
    text += [
        "",
        f"The same frame by other programs: {COLUMNS} x {ROWS} pixels, 0 to {ELECTRONS:.0f} electrons,",
        "one thread.",
        "",
        "| program | ms | Mpixel/s | times etendue's |",
        "|---|---|---|---|",
    ]
    for name, seconds in rows:
        middle = statistics.median(seconds)
        times = middle / statistics.median(ours["poisson"])
        milliseconds = spread([1e3 * s for s in seconds])
        rate = COLUMNS * ROWS / middle / 1e6
        text.append(f"| {name} | {milliseconds} | {rate:.1f} | {times:.1f} |")
        if not name.startswith("etendue"):
            # What draws by the normal approximation is compared with etendue's own.
            if name.endswith("normal"):
                times = middle / statistics.median(ours["normal"])
            goals.append((f"{name}, times etendue's", times, 5.0, True))


def main():
    arguments = program.arguments(__doc__, "measurements/sensors.md", rounds=5).parse_args()
    # One thread against one thread.
    program.enter("sensor-peers", ["numpy<2", "prysm==0.21.1", "emva1288==1.0.2"],
                  OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
    text = [
        f"`make bench-sensor` writes this section. Medians of {arguments.rounds} rounds, with the least and the",
        f"greatest. Machine: {machine()}.",
        "",
    ]
    goals = []
    large_frames(arguments.rounds, text, goals)
    side_by_side(arguments.rounds, text, goals)
    text += ["", "| goal | | measured | |", "|---|---|---|---|"]
    for name, value, bound, at_least in goals:
        met = value >= bound if at_least else value <= bound
        sign = "at least" if at_least else "at most"
        text.append(
            f"| {name} | {sign} {bound:.0f} | {value:.1f} | {'met' if met else '**missed**'} |"
            if at_least
            else f"| {name} | {sign} {bound:.1f} | {value:.2f} | {'met' if met else '**missed**'} |"
        )
    put(arguments.output, "bench-sensor", "\n".join(text))
    print("\n".join(text))


if __name__ == "__main__":
    main()

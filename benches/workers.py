"""Times frames that worker processes render, as those of a data loader do: by one worker, by two and by sixteen.

    python benches/workers.py [--frames N] [--rounds N] [--output PAGE]

Each worker renders its share of the frames of an orbit around scenes/cube.json with one thread, after all have opened the scene. Of
rounds in turns it tells medians of the time until the last worker is done, and of the processor time of all workers, each for a
frame: where other programs work on the same machine, the first says little, and the second says what workers cost each other. Run by
`make bench-workers` with the wheel that `make python` made last; the table goes into docs/measurements/benchmarks-python.md.
"""

import argparse
import multiprocessing
import os
import statistics
import time
from pathlib import Path

import etendue
import section

ROOT = Path(__file__).resolve().parent.parent
WORKERS = [1, 2, 16]
SETTINGS = {"layers": ["depth"], "camera.sensor.resolution": [64, 48]}


def work(count, number, workers, ready, sender):
    """Renders the frames of one worker and tells what processor time they took (s)."""
    orbit = {"frames": {"type": "orbit", "count": count}}
    frames = etendue.load(ROOT / "scenes/cube.json", {**orbit, **SETTINGS}, threads=1).frames(samples=4)
    frames[number]
    ready.wait()
    begin = time.process_time()
    for index in range(number, count, workers):
        frames[index]
    sender.send(time.process_time() - begin)


def measure(count, workers):
    """Time and processor time for a frame (s)."""
    context = multiprocessing.get_context("fork")
    ready = context.Barrier(workers + 1)
    pipes = [context.Pipe(duplex=False) for _ in range(workers)]
    children = [
        context.Process(target=work, args=(count, number, workers, ready, sender)) for number, (_, sender) in enumerate(pipes)
    ]
    for child in children:
        child.start()
    ready.wait()
    begin = time.perf_counter()
    processor = sum(receiver.recv() for receiver, _ in pipes)
    took = time.perf_counter() - begin
    for child in children:
        child.join()
    return took / count, processor / count


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=1600)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--output", type=Path)
    arguments = parser.parse_args()
    found = {workers: [] for workers in WORKERS}
    for _ in range(arguments.rounds):
        for workers in WORKERS:
            found[workers].append(measure(arguments.frames, workers))
    cores = len(os.sched_getaffinity(0))
    lines = [
        f"{arguments.frames} frames of 64 × 48 pixels with four samples on {cores} processors, {arguments.rounds} rounds in turns, medians. *At best*"
        " is what so many processors would give by the processor time of a frame, if they had nothing else to do.",
        "",
        "| workers | a frame | faster than one worker | processor time of a frame | at best |",
        "|---|---|---|---|---|",
    ]
    alone = [statistics.median(column) for column in zip(*found[1])]
    for workers, rounds in found.items():
        took, processor = (statistics.median(column) for column in zip(*rounds))
        best = min(workers, cores) * alone[1] / processor
        lines.append(f"| {workers} | {1e3 * took:.2f} ms | {alone[0] / took:.2f} times | {1e3 * processor:.2f} ms | {best:.2f} times |")
    lines += ["", f"{section.machine()}."]
    print("\n".join(lines))
    if arguments.output:
        section.put(arguments.output, "workers", "\n".join(lines))


if __name__ == "__main__":
    main()

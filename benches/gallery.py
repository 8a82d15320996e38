"""Renders the pictures of docs/guide/gallery.md by the commands of that page, and writes there what each took.

A section of the page is a heading, a block of commands, comments that say which of the files are shown, and
a line between two comments for the times:

    <!-- picture: ../images/fig3.png = fig3/picture.png -->
    <!-- bands: ../images/gallery/bands.png = spectrum/views_spectrum.npy 1 4 8 11 -->
    <!-- refocus: ../images/gallery/refocus.webp = refocus/views.npy -3.2 2.6 -->
    <!-- took: begin -->...<!-- took: end -->
    <!-- noise: begin -->...<!-- noise: end -->

A picture whose name ends in `.jpg` is kept as JPEG. Words choose among the sections: those whose heading or commands have
one of them. With `--noise` the pictures are left as they are: each is rendered once more with another seed, and what
noise the two have is written between the comments.
"""

import argparse
import math
import os
import re
import shutil
import struct
import subprocess
import sys
import time
import zlib
from array import array
from ast import literal_eval
from pathlib import Path

import program
import section

PAGE = program.ROOT / "docs" / "guide" / "gallery.md"
OUT = "out/gallery"

# Views of a light field have few pixels: each is shown as a square of so many.
MAGNIFIED = 8
# Pixels along a square of which noise is measured.
SQUARE = 8
# Pictures of an animation on its way from near to far.
REFOCUSED = 16
SIGNATURE = b"\x89PNG\r\n\x1a\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("words", nargs="*", help="of the sections to render; all when there are none")
    parser.add_argument("--noise", action="store_true", help="measure the noise of pictures that are there")
    arguments = parser.parse_args()
    words = arguments.words
    program.enter("gallery-venv", ["numpy", "pillow"])
    etendue = program.built("etendue")
    parts = re.split(r"(?m)^(?=## )", PAGE.read_text())
    for number, part in enumerate(parts):
        commands = commands_of(part)
        if not commands or words and not any(word in part_key(part, commands) for word in words):
            continue
        print(part.splitlines()[0], file=sys.stderr)
        if arguments.noise:
            parts[number] = with_noise(etendue, part, commands)
            PAGE.write_text("".join(parts))
            continue
        times = [took(etendue, command) for command in commands]
        for target, source in comments(part, "picture"):
            show(source, target)
        for target, source in comments(part, "bands"):
            bands(*source.split(), target=target)
        for target, source in comments(part, "refocus"):
            refocus(*source.split(), target=target)
        parts[number] = with_times(part, times)
        # What is done stays when a later command fails.
        PAGE.write_text("".join(parts))
    if not arguments.noise:
        section.put(PAGE, "machine", f"Machine: {section.machine()}; {len(os.sched_getaffinity(0))} processors.")


def commands_of(part):
    """The commands of a section, each as one line."""
    blocks = re.findall(r"(?ms)^```sh\n(.*?)^```", part)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    return [line for line in lines if line.startswith("etendue ")]


def part_key(part, commands):
    return "\n".join([part.splitlines()[0].lower(), *commands])


def took(etendue, command):
    """Seconds on the clock and of the processors that a command takes."""
    words = re.findall(r"'([^']*)'|(\S+)", command)
    words = [quoted or plain for quoted, plain in words][1:]
    before, start = os.times(), time.monotonic()
    done = subprocess.run([etendue, *words], cwd=program.ROOT, stdout=subprocess.DEVNULL)
    if done.returncode:
        raise SystemExit(f"{command}: failed")
    after = os.times()
    processor = sum(after[2:4]) - sum(before[2:4])
    return time.monotonic() - start, processor


def comments(part, kind):
    """The pairs of target and source of a section's comments of a kind."""
    return re.findall(rf"<!-- {kind}: (\S+) = (.*?) -->", part)


def with_times(part, times):
    clock = ", ".join(f"{seconds:.1f} s" for seconds, _ in times)
    processor = sum(processor for _, processor in times)
    text = f"Time: {clock}; {processor:.0f} s of processor time."
    return re.sub(r"(?s)(<!-- took: begin -->).*?(<!-- took: end -->)", rf"\1{text}\2", part)


def show(source, target):
    """Puts a file that was rendered where the page shows it; pictures as small as they get."""
    source, target = program.ROOT / OUT / source, PAGE.parent / target
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.suffix == ".jpg":
        from PIL import Image

        # Colours at full resolution: coloured edges are what some of these pictures are about.
        Image.open(source).convert("RGB").save(target, quality=90, subsampling=0, optimize=True)
        return
    if source.suffix != ".png":
        shutil.copyfile(source, target)
        return
    header, rows = read_png(source)
    write_png(target, header, rows)


def read_png(path):
    """The header of a PNG and its filtered rows; what else stands in the file is left out."""
    data = path.read_bytes()
    header, packed, at = b"", b"", len(SIGNATURE)
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        kind, content = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        header = content if kind == b"IHDR" else header
        packed += content if kind == b"IDAT" else b""
        at += length + 12
    return header, zlib.decompress(packed)


def write_png(path, header, rows):
    def chunk(kind, content):
        check = zlib.crc32(kind + content)
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)

    chunks = [chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(rows, 9)), chunk(b"IEND", b"")]
    path.write_bytes(SIGNATURE + b"".join(chunks))


def bands(source, *numbers, target):
    """The middle view of a light field in some of its bands, side by side: each in grey, as sRGB."""
    data = (program.ROOT / OUT / source).read_bytes()
    (length,) = struct.unpack("<H", data[8:10])
    about = literal_eval(data[10 : 10 + length].decode())
    down, across, height, width, count = about["shape"]
    values = array({"<f4": "f", "<f8": "d"}[about["descr"]], data[10 + length :])
    start = (down // 2 * across + across // 2) * height * width * count
    view = values[start : start + height * width * count]
    most = max(view)
    codes = [round(255 * encoded(value / most)) for value in view]
    rows = bytearray()
    for row in range(height):
        line = bytearray(1)
        for band in map(int, numbers):
            first = row * width * count + band
            for code in codes[first : first + width * count : count]:
                line += bytes([code]) * MAGNIFIED
        rows += line * MAGNIFIED
    size = [width * len(numbers) * MAGNIFIED, height * MAGNIFIED]
    header = struct.pack(">IIBBBBB", *size, 8, 0, 0, 0, 0)
    write_png(PAGE.parent / target, header, bytes(rows))


def refocus(source, near, far, *, target):
    """Views of a light field, moved against one another by `near` to `far` pixels a view and back, and added up: an
    animation whose sharp plane goes through the scene."""
    import numpy as np
    from PIL import Image

    views = np.load(program.ROOT / OUT / source, mmap_mode="r")
    count = views.shape[0]
    steps = np.linspace(float(near), float(far), REFOCUSED)
    white = np.percentile(views[count // 2, count // 2], 99.5)
    frames = []
    for step in steps:
        light = np.clip(focused(views, step) / white, 0, 1)
        code = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        frames.append(Image.fromarray(np.rint(255 * code).astype(np.uint8)))
    frames += frames[-2:0:-1]
    frames[0].save(PAGE.parent / target, save_all=True, append_images=frames[1:], duration=90, loop=0, quality=75,
                   method=6)


def focused(views, step):
    """The mean of all views, each moved by `step` pixels for each view that it is from the middle one."""
    count = views.shape[0]
    total = 0.0
    for down in range(count):
        for across in range(count):
            by = [step * (down - (count - 1) / 2), step * (across - (count - 1) / 2)]
            total = total + moved(views[down, across], by)
    return total / count**2


def moved(view, by):
    """A picture moved down and right by parts of pixels, its border repeated: bilinear."""
    import numpy as np

    whole = np.floor(by).astype(int)
    rest = np.array(by) - whole
    total = 0.0
    for down in (0, 1):
        for across in (0, 1):
            weight = (rest[0] if down else 1 - rest[0]) * (rest[1] if across else 1 - rest[1])
            rows = np.clip(np.arange(view.shape[0]) - whole[0] - down, 0, view.shape[0] - 1)
            columns = np.clip(np.arange(view.shape[1]) - whole[1] - across, 0, view.shape[1] - 1)
            total = total + weight * view[np.ix_(rows, columns)].astype(np.float64)
    return total


def with_noise(etendue, part, commands):
    """The section with the noise of its denoised pictures, and of a light field focused half way: of each two renders with
    different seeds."""
    import numpy as np

    refocused = [source.split() for _, source in comments(part, "refocus")]
    found = []
    for command in commands:
        words = command.split()
        if "--denoise" not in words and not refocused:
            continue
        folder = words[words.index("-o") + 1]
        again = folder.replace(OUT, "out/gallery-again")
        took(etendue, command.replace(f"-o {folder}", f"-o {again}") + " --seed 1")
        folders = [program.ROOT / name for name in (folder, again)]
        if refocused:
            (source, *ends) = refocused[0]
            step = sum(map(float, ends)) / 2
            views = (np.load(place / Path(source).name, mmap_mode="r") for place in folders)
            pictures = [focused(of_one, step) for of_one in views]
        else:
            pictures = [np.load(place / "denoised.npy") for place in folders]
        found.append(noise(*pictures))
        print(f"{folder}: {100 * found[-1]:.2f} %", file=sys.stderr)
    if not found:
        return part
    shares = ", ".join(f"{100 * share:.2f} %" for share in found)
    return re.sub(r"(?s)(<!-- noise: begin -->).*?(<!-- noise: end -->)", rf"\1Noise: {shares}.\2", part)


def noise(*pictures):
    """The standard deviation of a pixel's light as a share of that light, the median of all squares of pixels that have any,
    from two pictures that differ by their seeds: one difference says little of a pixel, those of a square do."""
    import numpy as np

    first, second = (squares(picture.astype(np.float64).mean(axis=-1)) for picture in pictures)
    deviation = np.sqrt(np.mean((first - second) ** 2, axis=(1, 3)) / 2)
    light = np.mean(first + second, axis=(1, 3)) / 2
    return float(np.median(deviation[light > 0] / light[light > 0]))


def squares(values):
    """Rows and columns of a picture by squares of pixels, `[row][row in it][column][column in it]`; what is over is left out."""
    down, across = (size // SQUARE for size in values.shape)
    return values[: down * SQUARE, : across * SQUARE].reshape(down, SQUARE, across, SQUARE)


def encoded(light):
    """sRGB's code of a linear value (IEC 61966-2-1)."""
    light = min(max(light, 0.0), 1.0)
    return 12.92 * light if light <= 0.0031308 else 1.055 * math.pow(light, 1 / 2.4) - 0.055


if __name__ == "__main__":
    main()

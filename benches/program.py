"""Other programs, each in a process of its own, in a virtual environment below target/."""

import argparse
import importlib.metadata
import json
import os
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve()

# Begins each line that answers, among what programs print of their own accord.
ANSWER = "answer: "


def arguments(about, page, rounds):
    """The parser of what every comparison is told; `about` is its documentation."""
    parser = argparse.ArgumentParser(description=" ".join(about.split("\n\n")[0].split()))
    parser.add_argument("--rounds", type=int, default=rounds, help="times that each is timed")
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / page,
                        help="the page to write")
    return parser


def built(name):
    """The path of a program of this repository."""
    path = TARGET / "release" / name
    if not path.exists():
        raise SystemExit(f"{path} is missing: the words of the Makefile build it")
    return str(path)


def enter(folder, packages=(), **variables):
    """Goes on in the virtual environment `folder`, which is made if need be, with `packages`."""
    place = TARGET / folder
    if Path(sys.prefix).resolve() == place:
        return
    python = place / "bin" / "python"
    if not python.exists():
        print(f"making an environment in {place}", file=sys.stderr)
        venv.create(place, with_pip=True)
    installed, words = install(packages, python)
    if not installed:
        raise SystemExit(f"pip could not install {', '.join(packages)}: {words}")
    # Nothing is left beside the sources.
    variables["PYTHONDONTWRITEBYTECODE"] = "1"
    os.execve(python, [str(python), *sys.argv], os.environ | variables)


def install(packages, python=sys.executable):
    """Whether pip could install `packages`, and its last words if not."""
    if not packages:
        return True, ""
    done = subprocess.run([python, "-m", "pip", "install", "-q", "--disable-pip-version-check",
                           *packages], capture_output=True, text=True)
    words = done.stderr.strip().splitlines()
    return done.returncode == 0, words[-1] if words else ""


def version(package):
    return importlib.metadata.version(package)


class Peer:
    """A program in a process of its own: a script that [`serve`]s when it is told `--serve`."""

    def __init__(self, script, *arguments):
        self.process = subprocess.Popen(
            [sys.executable, script, "--serve", *map(str, arguments)], text=True,
            env=os.environ | {"TF_CPP_MIN_LOG_LEVEL": "3"},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    def ask(self, *words):
        """What it answers to `words`; it does nothing until it is asked."""
        try:
            self.process.stdin.write(json.dumps(words) + "\n")
            self.process.stdin.flush()
        except BrokenPipeError:
            pass
        for line in self.process.stdout:
            if line.startswith(ANSWER):
                return json.loads(line.removeprefix(ANSWER))
        lines = self.process.stderr.read().strip().splitlines()
        raise RuntimeError(lines[-1] if lines else "it ended without a word")

    def end(self):
        self.process.stdin.close()
        try:
            self.process.wait(timeout=30)
        except subprocess.TimeoutExpired:
            self.process.kill()


def begin(main, serve):
    """Runs `main`, or `serve` with the words of the command line in a process of a [`Peer`]."""
    if sys.argv[1:2] == ["--serve"]:
        serve(*sys.argv[2:4])
    else:
        main()


def serve(answer):
    """Answers each line of words from standard input."""
    for line in sys.stdin:
        print(ANSWER + json.dumps(answer(*json.loads(line))), flush=True)

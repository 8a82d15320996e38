#!/usr/bin/env python3
"""Coverage-guided fuzzing of every reader of files: an hour of processor time in all, one job.

usage: fuzz.py [--minutes N] [--page FILE] [TARGET ...]

Each of the targets has the same share. An input may take 5 s of processor time and the process 1 GiB,
and is less than 1 MB. What fails is kept in out/fuzz-guided/TARGET, the inputs that reach new code in
fuzz/corpus/TARGET, where the next run starts from. Needs a nightly compiler and cargo-fuzz.
--page writes the table between the lines `<!-- fuzz: begin -->` and `<!-- fuzz: end -->` of FILE.
"""

import argparse
import os
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LONGEST = 1_000_000
MEMORY_MB = 1024
# A failure ends the process; the target goes on without that input, up to so many.
MOST_FAILURES = 5
BEGIN, END = "<!-- fuzz: begin -->", "<!-- fuzz: end -->"


def output(*command):
    return subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout


def children_seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def build():
    """The folder of the programs, one a target. Without a sanitizer: safe code has nothing for it."""
    host = re.search(r"host: (\S+)", output("rustc", "-vV")).group(1)
    subprocess.run(["cargo", "+nightly", "fuzz", "build", "--sanitizer", "none"], cwd=ROOT, check=True)
    return ROOT / "fuzz/target" / host / "release"


class Tally:
    """What the runs of one target came to."""

    def __init__(self, name):
        self.name = name
        self.executions = self.peak_mb = self.slowest_us = self.failures = 0
        self.seconds = 0.0

    def add(self, told, seconds):
        def most(pattern):
            return max((int(found) for found in re.findall(pattern, told)), default=0)

        self.seconds += seconds
        # The final statistics are missing where an input ended the process.
        done = most(r"stat::number_of_executed_units:\s+(\d+)") or most(r"(?m)^#(\d+)\s")
        self.executions += done
        self.peak_mb = max(self.peak_mb, most(r"stat::peak_rss_mb:\s+(\d+)"), most(r"rss: (\d+)Mb"))
        self.slowest_us = max(self.slowest_us, most(r"slowest: (\d+) us"))

    def row(self):
        slowest = f"{self.slowest_us / 1e6:.2f}"
        return [self.name, f"{self.executions:,}", f"{self.seconds:.0f}", slowest, str(self.peak_mb),
                str(self.failures)]


def run(program, share):
    """Runs one target until it has had its share of processor time (s)."""
    tally = Tally(program.name)
    corpus = ROOT / "fuzz/corpus" / program.name
    kept = ROOT / "out/fuzz-guided" / program.name
    kept.mkdir(parents=True, exist_ok=True)
    while tally.seconds < 0.97 * share and tally.failures < MOST_FAILURES:
        before = children_seconds()
        with tempfile.TemporaryDirectory() as scratch:
            done = subprocess.run(
                # Time on the clock is the processor's at most; `-timeout` is for what waits for ever.
                [program, corpus, f"-max_total_time={max(1, round(share - tally.seconds))}", "-timeout=600",
                 f"-max_len={LONGEST}", f"-rss_limit_mb={MEMORY_MB}",
                 # Of an allocation that fails the reader makes an error.
                 "-malloc_limit_mb=1048576", f"-artifact_prefix={kept}/", "-print_final_stats=1"],
                env={**os.environ, "RAYON_NUM_THREADS": "1", "TMPDIR": scratch},
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
        told = done.stdout.decode(errors="replace")
        tally.add(told, children_seconds() - before)
        if done.returncode != 0:
            tally.failures += 1
            print(f"{program.name}: FAILED, kept in {kept}:", *told.splitlines()[-12:], sep="\n  ", flush=True)
    return tally


def table(tallies):
    rows = [["target", "executions", "processor time (s)", "slowest (s)", "peak of memory (MiB)", "failures"],
            ["---"] * 6, *(tally.row() for tally in tallies)]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--page", type=Path)
    parser.add_argument("targets", nargs="*")
    arguments = parser.parse_args()
    output("cargo", "run", "--quiet", "-p", "etendue-fuzz", "--", "--write-seeds", "fuzz/corpus")
    programs = build()
    known = output("cargo", "+nightly", "fuzz", "list").split()
    targets = arguments.targets or known
    share = arguments.minutes * 60 / len(targets)
    tallies = []
    for name in targets:
        tallies.append(run(programs / name, share))
        print(*tallies[-1].row(), sep="  ", flush=True)
    total = sum(tally.executions for tally in tallies)
    text = table(tallies) + f"\n\nIn all {total:,} executions in {arguments.minutes:g} minutes of processor time."
    print(text)
    if arguments.page:
        page = arguments.page.read_text()
        before, rest = page.split(BEGIN)
        _, after = rest.split(END)
        arguments.page.write_text(f"{before}{BEGIN}\n\n{text}\n\n{END}{after}")
    return 1 if any(tally.failures for tally in tallies) else 0


if __name__ == "__main__":
    sys.exit(main())

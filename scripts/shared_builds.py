"""Checks that the parts of the workspace that scripts/test.sh builds apart take every dependency as the whole is built with.

    python3 scripts/shared_builds.py

Nothing is built: cargo's graph of units is compared, which has the features of each. What differs is told by name; add it to
tests/dependencies/Cargo.toml (a dependency that is new) or to `checkout` in crates/python/Cargo.toml (a feature of a crate here).
"""

import json
import os
import subprocess
import sys

WHOLE = ["--workspace", "--features", "etendue-cli/window"]
# What only parts build, or what is empty.
ONCE = ("python#", "dependencies#")

WITHOUT_EMBREE = ["etendue-dependencies", "etendue-accel", "etendue", "etendue-cli"]
WITH_EMBREE_4 = ["etendue-dependencies", "etendue-embree-sys", "etendue-accel", "etendue-stability", "etendue", "etendue-cli"]


def units(arguments):
    """The libraries and build scripts that cargo would build: name, kind, features, and all below them."""
    # Stable cargo has the graph, too, but shows it to its own developers alone.
    environment = dict(os.environ, RUSTC_BOOTSTRAP="1")
    command = ["cargo", *arguments, "-Z", "unstable-options", "--unit-graph", "--locked"]
    graph = json.loads(subprocess.check_output(command, env=environment))["units"]
    known = {}

    def key(index):
        if index not in known:
            unit = graph[index]
            name = unit["pkg_id"].rsplit("/", 1)[-1]
            own = (name, *unit["target"]["kind"], unit["mode"], str(unit["platform"]), *sorted(unit["features"]))
            known[index] = (own, frozenset(key(one["index"]) for one in unit["dependencies"]))
        return known[index]

    return {key(index) for index in range(len(graph))}


def packages(names):
    return [word for name in names for word in ("-p", name)]


def own(unit):
    return unit[0][0].split("#")[-1].split("@")[0].startswith(("etendue", "0."))


def main():
    tests = ["test", "--no-run", "--lib", "--bins", "--tests"]
    whole = units([*tests, *WHOLE])
    parts = {
        "tests without Embree": [*tests, "--no-default-features", *packages(WITHOUT_EMBREE)],
        "tests against Embree 4": [*tests, *packages(WITH_EMBREE_4)],
        "Python package": ["build", "--lib", "-p", "etendue-python", "--features", "etendue-python/checkout"],
    }
    # The package that names all of them must not bring builds of its own.
    brought = whole - units([*tests, *WHOLE, "--exclude", "etendue-dependencies"])
    names = sorted({one[0][0] for one in brought if not own(one)})
    print(f"etendue-dependencies itself: {len(names)} dependencies more", *names, sep="\n    " if names else " ")
    twice = bool(names)
    for part, arguments in parts.items():
        # Crates of this workspace are built again where they trace by another Embree; the Python package is not.
        again = [one for one in units(arguments) - whole if not own(one) or part == "Python package"]
        names = sorted({" ".join(one[0][:3]) for one in again if not one[0][0].startswith(ONCE)})
        twice |= bool(names)
        print(f"{part}: {len(names)} dependencies once more", *names, sep="\n    " if names else " ")
    if twice:
        sys.exit("shared_builds: these are built twice; see the head of this script")


if __name__ == "__main__":
    main()

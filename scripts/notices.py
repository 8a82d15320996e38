"""Writes the notices of everything that is built into a program: crates, and libraries that are put beside it.

    python3 scripts/notices.py PACKAGE OUT [--no-default-features] [--library FILE]...

PACKAGE is a package of this workspace (etendue-cli, etendue-python), whose crates are those that cargo would build for this
machine; each comes with its licence, its authors and the texts that its own package has. A --library is a shared library of a
Debian package, whose copyright file is copied. Which licences may be there at all is deny.toml's matter.
"""

import argparse
import hashlib
import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
TEXTS = re.compile(r"^(licen[cs]e|copying|copyright|notice|unlicense)", re.IGNORECASE)
LINE = "=" * 78


def crates(package, no_default_features):
    """The packages from elsewhere that `package` is built from, in the order of their names."""
    host = re.search(r"host: (.*)", subprocess.check_output(["rustc", "-vV"], text=True)).group(1)
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", host]
    if no_default_features:
        manifest = next(ROOT.glob(f"crates/{package.removeprefix('etendue-')}/Cargo.toml"))
        command += ["--no-default-features", "--manifest-path", str(manifest)]
    found = json.loads(subprocess.check_output(command, cwd=ROOT))
    packages = {one["id"]: one for one in found["packages"]}
    nodes = {node["id"]: node for node in found["resolve"]["nodes"]}
    start = next(identity for identity, one in packages.items() if one["name"] == package)
    seen, open_ = set(), [start]
    while open_:
        identity = open_.pop()
        if identity in seen:
            continue
        seen.add(identity)
        for dependency in nodes[identity]["deps"]:
            # What only builds or tests is in no program.
            if any(kind["kind"] is None for kind in dependency["dep_kinds"]):
                open_.append(dependency["pkg"])
    others = [packages[identity] for identity in seen if packages[identity]["source"] is not None]
    return sorted(others, key=lambda one: (one["name"], one["version"]))


def texts_of(one):
    """The licence texts in a crate's package, by their names."""
    folder = pathlib.Path(one["manifest_path"]).parent
    named = {folder / one["license_file"]} if one["license_file"] else set()
    files = named | {path for path in folder.iterdir() if path.is_file() and TEXTS.match(path.name)}
    folders = [folder / "LICENSES", folder / "licenses", folder / "LICENSE"]
    files |= {path for inner in folders if inner.is_dir() for path in inner.iterdir() if path.is_file()}
    return {path.name: path.read_text(errors="replace").strip() for path in sorted(files) if path.exists()}


def standard(expression):
    """The project's own copies of the texts that an expression names, for crates that bring none."""
    own = {"MIT": ROOT / "LICENSE-MIT", "Apache-2.0": ROOT / "LICENSE-APACHE"}
    return next((path.read_text().strip() for name, path in own.items() if name in expression), None)


def copyright_of(library):
    """Name and version of the Debian package that has a library, and its copyright file."""
    real = pathlib.Path(library).resolve()
    names = [str(real), str(real).removeprefix("/usr")]
    owner = None
    for name in names:
        found = subprocess.run(["dpkg", "-S", name], capture_output=True, text=True)
        if found.returncode == 0:
            owner = found.stdout.split(":")[0]
            break
    if owner is None:
        sys.exit(f"{library}: no Debian package has it, so its notices are not known")
    version = subprocess.check_output(["dpkg-query", "-W", "-f", "${Version}", owner], text=True)
    return f"{owner} {version}", pathlib.Path(f"/usr/share/doc/{owner}/copyright").read_text().strip()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("package")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--no-default-features", action="store_true")
    parser.add_argument("--library", action="append", default=[])
    arguments = parser.parse_args()
    found = crates(arguments.package, arguments.no_default_features)
    shared, parts = {}, []
    parts.append(f"What is built into {arguments.package}, beside its own code, and under which licences.\n")
    for library in arguments.library:
        name, text = copyright_of(library)
        parts.append(f"{LINE}\n{name}, in {pathlib.Path(library).name}\n{LINE}\n\n{text}\n")
    silent = []
    for one in found:
        texts = texts_of(one)
        expression = one["license"] or "see the text"
        if not texts:
            text = standard(expression)
            silent += [] if text else [f"{one['name']} {one['version']} ({expression})"]
            texts = {"(its package has no text; the licence's own)": text or ""}
        lines = [f"{one['name']} {one['version']}, {expression}"]
        lines += [f"by {', '.join(one['authors'])}"] if one["authors"] else []
        lines += [one["repository"]] if one["repository"] else []
        for name, text in texts.items():
            # Texts that many crates have stand once, at the end.
            key = hashlib.sha256(" ".join(text.split()).encode()).hexdigest()[:8]
            shared.setdefault(key, text)
            lines.append(f"    {name}: text {key}")
        parts.append("\n".join(lines) + "\n")
    if silent:
        sys.exit(f"no text of the licence is known for: {', '.join(silent)}; add it to {__file__}")
    for key, text in sorted(shared.items()):
        parts.append(f"{LINE}\ntext {key}\n{LINE}\n\n{text}\n")
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text("\n".join(parts))
    print(f"{arguments.out}: {len(found)} crates, {len(arguments.library)} libraries, {len(shared)} texts")


if __name__ == "__main__":
    main()

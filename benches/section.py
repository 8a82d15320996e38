"""A section of a page that a command writes: between two comments that name it."""

import platform
import statistics
import subprocess
from pathlib import Path


def machine():
    """The processor, and which etendue was measured."""
    model = platform.processor() or platform.machine()
    fields = {}
    try:
        with open("/proc/cpuinfo") as lines:
            for line in lines:
                key, _, value = (part.strip() for part in line.partition(":"))
                fields.setdefault(key, value)
    except OSError:
        pass
    if "model name" in fields:
        family, number = fields.get("cpu family", "?"), fields.get("model", "?")
        model = f"{fields['model name']} (family {family}, model {number})"
    return f"{model}; etendue at commit {commit()}; Python {platform.python_version()}"


def commit():
    """The commit that is checked out, and whether anything but documents was changed since."""
    git = lambda *words: subprocess.run(["git", "-C", Path(__file__).parent, *words], capture_output=True,
                                        text=True).stdout.strip()
    changes = git("status", "--porcelain", "--", ":/", ":(top,exclude)docs")
    return (git("rev-parse", "--short", "HEAD") or "unknown") + (" with changes" if changes else "")


def spread(values, digits=1):
    """The median, with the least and the greatest in brackets."""
    middle, low, high = statistics.median(values), min(values), max(values)
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def put(page, name, text):
    """Replaces the section `name` of `page`, or adds it at its end."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    page = Path(page)
    before, _, rest = (page.read_text() if page.exists() else "").partition(begin)
    after = rest.partition(end)[2] or "\n"
    page.write_text(f"{before}{begin}\n\n{text.strip()}\n\n{end}{after}")

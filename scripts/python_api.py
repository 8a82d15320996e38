"""Writes docs/reference/python-api.md from the Python package's source: every public class, method, property and field.

    python3 scripts/python_api.py [--check]

With --check it writes nothing, and fails where the page is another. A name of `__all__` or a public member without words is
an error.
"""

import ast
import pathlib
import re
import sys
import textwrap

ROOT = pathlib.Path(__file__).resolve().parents[1]
SOURCE = ROOT / "crates/python/python/etendue/__init__.py"
PAGE = ROOT / "docs/reference/python-api.md"
SPECIAL = {
    "__init__": "{cls}(…)", "__getitem__": "[…]", "__setitem__": "[…] = …", "__delitem__": "del […]",
    "__contains__": "in", "__len__": "len(…)", "__iter__": "for … in",
}  # fmt: skip
HEAD = """# The Python package, name by name

`make generated` writes this page from the package's source; a test fails when they differ. [The guide](../guide/python.md) is where to
begin. Arrays are numpy's; `(h, w)` are rows and columns, rows from the top.
"""


def words(node):
    """The words of a docstring, in lines as they are."""
    text = ast.get_docstring(node, clean=True)
    return text.strip() if text else None


def signature(function):
    """The call as one would write it, with types and defaults."""
    arguments = ast.unparse(function.args)
    arguments = arguments.removeprefix("self").removeprefix("cls").lstrip(", ")
    result = "" if function.returns is None else f" -> {ast.unparse(function.returns)}"
    # Names of the package's own classes stand in quotes where they come before their definition.
    call = re.sub(r"'([A-Z]\w*)'", r"\1", f"({arguments}){result}")
    return call.replace("_Path", "path")


def is_decorated(function, name):
    return any(isinstance(one, ast.Name) and one.id == name for one in function.decorator_list)


def members(cls):
    """Name, call, words and place of each public member: methods, properties, and fields with words behind them."""
    body = cls.body
    for k, node in enumerate(body):
        if isinstance(node, ast.FunctionDef):
            name = node.name
            if name.startswith("_") and (name not in SPECIAL or words(node) is None):
                continue
            shown = SPECIAL.get(name, name).format(cls=cls.name)
            if is_decorated(node, "property"):
                call = shown + (f": {ast.unparse(node.returns)}" if node.returns else "")
            elif name == "__init__":
                call = cls.name + signature(node).removesuffix(" -> None")
            elif name in SPECIAL:
                call = shown
            else:
                call = shown + signature(node)
            yield name, call, words(node), node
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            name = node.target.id
            if name.startswith("_"):
                continue
            behind = body[k + 1] if k + 1 < len(body) else None
            is_text = isinstance(behind, ast.Expr) and isinstance(behind.value, ast.Constant)
            text = textwrap.dedent(behind.value.value).strip() if is_text else None
            text = " ".join(text.split()) if text else None
            yield name, f"{name}: {ast.unparse(node.annotation)}", text, node


def entry(call, text):
    lines = [f"- `{call}`"]
    lines += textwrap.indent(text, "  ").splitlines() if text else []
    return "\n".join(line.rstrip() for line in lines)


def page():
    tree = ast.parse(SOURCE.read_text())
    public = next(
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__"
    )
    defined = {node.name: node for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    parts, silent = [HEAD], []
    for name in public:
        node = defined[name]
        if isinstance(node, ast.FunctionDef):
            parts.append(f"## `etendue.{name}`\n\n{entry(name + signature(node), words(node))}\n")
            continue
        text = words(node)
        list_of = list(members(node))
        # A named tuple's fields are said where they stand; what is made by others alone says nothing of its making.
        silent += [f"{name}.{member}" for member, _, text_of, _ in list_of if text_of is None and member != "__init__"]
        silent += [] if text else [name]
        listed = "\n".join(entry(call, text_of) for _, call, text_of, _ in list_of)
        parts.append(f"## `etendue.{name}`\n\n{text}\n\n{listed}\n")
    if silent:
        sys.exit(f"{SOURCE}: without words: {', '.join(silent)}")
    return "\n".join(parts).replace("typing.", "").rstrip() + "\n"


if __name__ == "__main__":
    text = page()
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(text)
    elif not PAGE.exists() or PAGE.read_text() != text:
        sys.exit(f"{PAGE} is not what the package says: run `make generated`")

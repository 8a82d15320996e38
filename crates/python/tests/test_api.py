"""The page of the package and the stubs of its core, against what there is."""

import ast
import subprocess
import sys

from test_etendue import CHECKOUT

import etendue
from etendue import _core


def test_the_page_is_that_of_the_source():
    script = CHECKOUT / "scripts" / "python_api.py"
    done = subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_page_has_every_name_that_is_public():
    page = (CHECKOUT / "docs/reference/python-api.md").read_text()
    for name in etendue.__all__:
        assert f"## `etendue.{name}`" in page
        for member in vars(getattr(etendue, name)) if isinstance(getattr(etendue, name), type) else []:
            assert member.startswith("_") or f"`{member}" in page, f"{name}.{member}"


def test_the_stubs_are_of_the_core_as_it_is():
    stubs = ast.parse((CHECKOUT / "crates/python/python/etendue/_core.pyi").read_text())
    for node in stubs.body:
        if isinstance(node, ast.FunctionDef):
            assert callable(getattr(_core, node.name))
        elif isinstance(node, ast.ClassDef):
            said = {one.name for one in node.body if isinstance(one, ast.FunctionDef)} - {"__init__"}
            own = vars(getattr(_core, node.name))
            there = {name for name in own if not name.startswith("_")}
            assert said == there, node.name
            for one in node.body:
                if isinstance(one, ast.FunctionDef) and one.name != "__init__":
                    names = [argument.arg for argument in one.args.args if argument.arg != "self"]
                    text = own[one.name].__text_signature__ if hasattr(own[one.name], "__text_signature__") else None
                    if text:
                        found = [name.strip(" $/,") for name in text.strip("()").split(",")]
                        assert names == [name for name in found if name not in ("self", "")], one.name

"""The type stubs list exactly the names of the module."""

import ast
import sys
from pathlib import Path

import pytest
import stylet
from stylet import _stylet

FOLDER = Path(stylet.__file__).parent


def test_the_stub_names_what_the_compiled_module_has():
    tree = ast.parse((FOLDER / "_stylet.pyi").read_text())
    stub = {node.name: node for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    have = {name for name in dir(_stylet) if not name.startswith("__")}
    assert set(stub) == have
    for name, node in stub.items():
        if isinstance(node, ast.ClassDef) and name != "StyletError":
            listed = {n.name for n in node.body if isinstance(n, ast.FunctionDef)} - {"__init__", "__new__", "__repr__"}
            real = {n for n in dir(getattr(_stylet, name)) if not n.startswith("_")}
            assert listed == real, name


def test_types_check():
    api = pytest.importorskip("mypy.api")
    out, err, code = api.run(["--strict-optional", "--ignore-missing-imports", "--python-version", "%d.%d" % sys.version_info[:2], str(FOLDER)])
    assert code == 0, out + err

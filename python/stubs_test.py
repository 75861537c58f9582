#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The type stubs say what the module says of itself: stubs_test.py FOLDER_OF_MODULE

Names, parameters, defaults, types and texts are compared with those that pybind11 writes into the documentation.
"""
import ast
import pathlib
import re
import sys
import unittest

STUBS = pathlib.Path(__file__).with_name("evpose-stubs") / "__init__.pyi"
sys.path.insert(0, sys.argv.pop(1))
import evpose  # noqa: E402


def stub_type(text, taken):
    """The type that a stub gives for one of pybind11's, which is taken from the caller or handed to it."""
    def array(found):
        kind = (found[1] or "float64").replace("numpy.", "").replace("bool", "bool_")
        return "ArrayLike" if taken else f"NDArray[np.{kind}]"

    text = re.sub(r"numpy\.ndarray(?:\[((?:numpy\.)?\w+)(?:\[[^]]*\])?\])?", array, text)
    for other, ours in (("evpose.", ""), ("List[", "list["), ("Dict[", "dict["), ("Tuple[", "tuple["),
                        ("os.PathLike", "str | PathLike[str]")):
        text = text.replace(other, ours)
    return re.sub(r"\bobject\b", "Any", text)


def signature(documentation, method=True):
    """Parameters with types, result and text of a function that pybind11 documents."""
    head, _, text = documentation.partition("\n")
    function = ast.parse("def " + (head if head[0] != "(" else "f" + head) + ": ...").body[0]
    arguments = [(a.arg, stub_type(ast.unparse(a.annotation), True)) for a in function.args.args[method:]]
    defaults = [ast.unparse(d) if isinstance(d, (ast.Constant, ast.Dict)) else "..." for d in function.args.defaults]
    return arguments, defaults, stub_type(ast.unparse(function.returns), False), text.strip()


def stub_signature(function, method=True):
    arguments = [(a.arg, ast.unparse(a.annotation)) for a in function.args.args[method:]]
    return (arguments, [ast.unparse(d) for d in function.args.defaults], ast.unparse(function.returns),
            ast.get_docstring(function))


def described(member):
    if isinstance(member, property):
        return (*signature(member.fget.__doc__)[:3], member.__doc__)
    return signature(member.__doc__)


class StubsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.tree = ast.parse(STUBS.read_text())
        cls.classes = {node.name: node for node in cls.tree.body if isinstance(node, ast.ClassDef)}
        cls.functions = {node.name: node for node in cls.tree.body if isinstance(node, ast.FunctionDef)}

    def test_names_of_the_module(self):
        names = {name for name in vars(evpose) if not name.startswith("_")}
        self.assertEqual(names, set(self.classes) | set(self.functions))
        self.assertEqual({name for name in names if isinstance(vars(evpose)[name], type)}, set(self.classes))
        self.assertEqual(ast.get_docstring(self.tree), evpose.__doc__)
        self.assertIsInstance(evpose.__version__, str)

    def test_functions_of_the_module(self):
        for name, node in self.functions.items():
            self.assertEqual(stub_signature(node, False), signature(getattr(evpose, name).__doc__, False), name)

    def test_members_of_the_classes(self):
        for name, node in self.classes.items():
            real = getattr(evpose, name)
            self.assertEqual(ast.get_docstring(node), real.__doc__)
            members = {key: value for key, value in vars(real).items()
                       if not key.startswith("_") or key == "__init__" and "self: evpose." in (value.__doc__ or "")}
            functions = {f.name: f for f in node.body if isinstance(f, ast.FunctionDef)}
            self.assertEqual(set(functions), set(members))
            for key, member in members.items():
                with self.subTest(f"{name}.{key}"):
                    self.assertEqual(stub_signature(functions[key]), described(member))
                    is_property = [ast.unparse(d) for d in functions[key].decorator_list] == ["property"]
                    self.assertEqual(is_property, isinstance(member, property))

    def test_the_checker_sees_a_wrong_name(self):
        wrong = ast.parse("class Tracker:\n def on_update(self, function: str) -> None:\n  ''").body[0].body[0]
        self.assertNotEqual(stub_signature(wrong), described(evpose.Tracker.on_update))


if __name__ == "__main__":
    unittest.main()

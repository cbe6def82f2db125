"""The type stub has the module's names and signatures, no more and no fewer."""
import ast
import inspect
import pathlib
import re

import cairn
from cairn import _cairn

STUB = ast.parse((pathlib.Path(cairn.__file__).parent / "__init__.pyi").read_text())
# Python defines these itself where a class has none.
OF_OBJECT = {"__init__", "__repr__", "__str__", "__doc__", "__module__", "__hash__", "__new__", "__dict__",
             "__weakref__"}


def stub_arguments(function, is_method):
    arguments = [a.arg for a in function.args.args][1 if is_method else 0:]
    defaults = [ast.unparse(d) for d in function.args.defaults]
    with_defaults = dict(zip(arguments[len(arguments) - len(defaults):], defaults))
    for argument, default in zip(function.args.kwonlyargs, function.args.kw_defaults):
        arguments.append(argument.arg)
        if default is not None:
            with_defaults[argument.arg] = ast.unparse(default)
    return [(name, with_defaults.get(name)) for name in arguments]


def split(text):
    """At commas that are not within brackets or strings."""
    parts, depth, quote = [""], 0, False
    for letter in text:
        quote ^= letter == "'"
        depth += (letter in "([{<") - (letter in ")]}>") if not quote else 0
        if letter == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts if part.strip()]


def module_arguments(function):
    """Of each overload: names with defaults, from the line that pybind11 puts before a docstring."""
    name = function.__name__
    overloads = re.findall(rf"^(?:\d+\. )?{re.escape(name)}\((.*)\) -> ", function.__doc__ or "", re.M)
    result = []
    for text in overloads:
        arguments = []
        for part in split(text.replace("->", "")):
            if part == "*" or part.startswith("self"):
                continue
            head, _, default = part.partition(" = ")
            arguments.append((head.split(":")[0], default or None))
        result.append(arguments)
    return result


def is_same(stub, module):
    if [name for name, _ in stub] != [name for name, _ in module]:
        return False
    for (_, expected), (_, given) in zip(stub, module):
        if (expected is None) != (given is None):
            return False
        if expected not in (None, "...", '""') and ast.dump(ast.parse(expected)) != ast.dump(ast.parse(given)):
            return False
    return True


def stub_functions(body):
    functions = {}
    for node in body:
        if isinstance(node, ast.FunctionDef):
            kinds = {ast.unparse(d) for d in node.decorator_list}
            if not any(kind.endswith("setter") for kind in kinds):
                functions.setdefault(node.name, []).append((node, kinds))
    return functions


def check_function(label, nodes, function, is_method):
    module = module_arguments(function)
    for node, kinds in nodes:
        stub = stub_arguments(node, is_method and "staticmethod" not in kinds)
        # Operators and what pybind11 does not name have positions alone.
        if any(is_same(stub, given) or [n for n, _ in given] in ([], ["arg0"], ["arg0", "arg1", "arg2"])
               and len(given) == len(stub) for given in module):
            continue
        raise AssertionError(f"{label}: the stub has {stub}, the module {module}")


def test_functions_and_classes_are_the_modules():
    stub_names = {n.name for n in STUB.body if isinstance(n, (ast.FunctionDef, ast.ClassDef))}
    module_names = {name for name, value in vars(_cairn).items() if not name.startswith("_") and callable(value)}
    assert stub_names == module_names
    for name, nodes in stub_functions(STUB.body).items():
        check_function(name, nodes, getattr(cairn, name), is_method=False)


def test_methods_and_attributes_are_the_classes():
    for node in (n for n in STUB.body if isinstance(n, ast.ClassDef)):
        given = getattr(cairn, node.name)
        functions = stub_functions(node.body)
        fields = {n.target.id: ast.unparse(n.annotation) for n in node.body if isinstance(n, ast.AnnAssign)}
        for name, annotation in fields.items():
            is_final = inspect.getattr_static(given, name).fset is None
            assert annotation.startswith("Final[") == is_final, f"{node.name}.{name}"
        if not issubclass(given, Exception):
            own = {name for name in vars(given) if not name.startswith("_") or name not in OF_OBJECT}
            own -= {name for name in own if name.startswith("_pybind")}
            assert own - {"__getstate__"} == (set(functions) | set(fields)) - OF_OBJECT, node.name
        for name, nodes in functions.items():
            value = inspect.getattr_static(given, name)
            if isinstance(value, property):
                assert any("property" in kinds for _, kinds in nodes), f"{node.name}.{name}"
                has_setter = any(isinstance(n, ast.FunctionDef) and n.name == name and
                                 any(ast.unparse(d).endswith("setter") for d in n.decorator_list) for n in node.body)
                assert (value.fset is not None) == has_setter, f"{node.name}.{name}"
            else:
                check_function(f"{node.name}.{name}", nodes, getattr(given, name), is_method=True)


def test_everything_has_a_docstring():
    for name in (n.name for n in STUB.body if isinstance(n, (ast.FunctionDef, ast.ClassDef))):
        documentation = getattr(cairn, name).__doc__ or ""
        lines = [line for line in documentation.splitlines() if line and not re.match(rf"{name}\(", line)]
        assert lines, name

"""Where mutants apply: by syntax tree, in a function that may have another name, place or layout."""
import ast

import pytest

from verification.mutants.anchors import AnchorError, change

CODE = '''LIMIT = 2.0


@cached(size=1)
def total(a, b):
    """Sum."""
    large = a * b + LIMIT   # a remark
    return f"{large + a}", large


class System:
    scale = 3.0

    def assemble(self, mesh):
        def inner(x):
            return x - self.scale
        first = mesh.size - self.scale
        if mesh.empty:
            first = 0.0
        return inner(first) + inner(first)
'''


def changed(tmp_path, function, old, new, code=CODE, file="repro/a.py", **others):
    """The mutated text of the file that has the code."""
    (tmp_path / "repro").mkdir(exist_ok=True)
    for name, text in {"a": code, **others}.items():
        (tmp_path / "repro" / f"{name}.py").write_text(text, encoding="utf-8")
    return change(tmp_path, file, function, old, new)


@pytest.mark.parametrize("function, old, new, before, after", [
    ("", "LIMIT = 2.0", "LIMIT = 1.0", "LIMIT = 2.0", "LIMIT = 1.0"),
    ("total", "a * b", "a + b", "a * b +", "a + b +"),
    ("total", "a*b", "a + b", "a * b +", "a + b +"),
    ("total", "cached(size=1)", "cached(size=2)", "size=1", "size=2"),
    ("total", 'f"{large + a}"', 'f"{large}"', "{large + a}", "{large}"),
    ("System", "scale = 3.0", "scale = 4.0", "scale = 3.0", "scale = 4.0"),
    ("System.assemble.inner", "x - self.scale", "x", "return x - self.scale", "return x"),
    ("System.assemble", "first = mesh.size - self.scale\nif mesh.empty:\n    first = 0.0",
     "first = mesh.size\nif mesh.empty:\n    first = 1.0", "first = mesh.size - self.scale\n        if mesh.empty:\n"
     "            first = 0.0", "first = mesh.size\n        if mesh.empty:\n            first = 1.0")])
def test_only_the_source_of_the_code_is_replaced(tmp_path, function, old, new, before, after):
    assert changed(tmp_path, function, old, new) == ("repro/a.py", CODE.replace(before, after))


def test_an_expression_stays_one_operand(tmp_path):
    _, text = changed(tmp_path, "total", "a * b", "a if b else 1.0")
    assert "large = (a if b else 1.0) + LIMIT" in text


@pytest.mark.parametrize("function, old, new, code, expected", [
    ("total", "a * b", "a + b", CODE.replace("a * b", "(a  # one\n             * b)"), "a + b"),
    ("total", "large = a * b + LIMIT", "large = b", CODE.replace("large", "product"), "product = b"),
    ("System.assemble", "mesh.size - self.scale", "mesh.size", CODE.replace("size", "count"), "first = mesh.count"),
    ("total", "a * b", "a + b", CODE.replace("total", "summed"), "a + b"),
    ("System.assemble", "mesh.size - self.scale", "mesh.size", CODE.replace("System", "Matrix"), "first = mesh.size\n"),
    ("System.scaled", "System.scale", "1.0", f"{CODE}\n    def scaled(self, a):\n        return System.scale".replace(
        "System", "Matrix"), "return 1.0"),
    ("", "LIMIT = 2.0", "LIMIT = 1.0", CODE.replace("LIMIT", "MOST"), "MOST = 1.0")],
    ids=["layout", "variable", "attribute", "function", "class", "class in its code", "constant"])
def test_a_change_of_layout_or_of_a_name_leaves_a_mutant_valid(tmp_path, function, old, new, code, expected):
    file, text = changed(tmp_path, function, old, new, code)
    assert file == "repro/a.py" and expected in text and ast.dump(ast.parse(text)) != ast.dump(ast.parse(code))


@pytest.mark.parametrize("name", ["total", "summed"])
def test_a_function_may_move_to_another_module(tmp_path, name):
    code = CODE.replace("total", name)
    assert changed(tmp_path, "total", "a * b", "a + b", "x = 1\n", b=code) == (
        "repro/b.py", code.replace("a * b", "a + b"))
    (tmp_path / "repro" / "a.py").unlink()
    assert change(tmp_path, "repro/a.py", "total", "a * b", "a + b")[0] == "repro/b.py"


@pytest.mark.parametrize("function, old, new, message", [
    ("System.assemble", "inner(first)", "first", "in 2 places"),
    ("total", "a / b", "a", "in 0 places"),
    ("total", "b * c", "b", "in 0 places"),
    ("total", "min(a, b)", "a", "in 0 places"),
    ("absent", "f(a) * g", "f(a)", "in 0 places"),
    ("total", "a * b", "a  *  b", "the change is none"),
    ("total", "a * * b", "a", "neither an expression")],
    ids=["twice", "none", "present name", "builtin", "no function", "no change", "no code"])
def test_code_in_no_place_or_in_two_is_refused(tmp_path, function, old, new, message):
    code = CODE.replace("large = a * b", "large = max(a, b) + a * b")
    with pytest.raises(AnchorError, match=message):
        changed(tmp_path, function, old, new, code)


def test_a_text_that_is_not_python_occurs_once(tmp_path):
    (tmp_path / "a.js").write_text("if (low) {}", encoding="utf-8")
    assert change(tmp_path, "a.js", "", "(low)", "(true)") == ("a.js", "if (true) {}")
    with pytest.raises(AnchorError, match="in 0 places"):
        change(tmp_path, "a.js", "", "(high)", "(true)")

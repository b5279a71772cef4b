"""The architecture, held by a test: imports point down, no cycles, none hidden, only the doors touch the world."""

import ast
from pathlib import Path

import pytest

import delaytools

HOUSE = Path(delaytools.__file__).parent
FLOOR = {
    "signals": 0,
    "blocks": 1,
    "linear": 1,
    "loop": 2,
    "effects": 3,
    "compensators": 3,
    "design": 4,
    "simulation": 5,
    "estimation": 5,
    "analysis": 6,
    "measurement": 6,
    "tuning": 7,
    "diagnosis": 7,
    "campaign": 7,
    "report": 8,
    "cli": 9,
    "studio": 9,
}
DOORS = (
    "design/file.py",
    "measurement/log_file.py",
    "measurement/formats/",
    "report/write.py",
    "cli/",
    "studio/",
)
FILES = sorted(path for path in HOUSE.rglob("*.py"))
NAMES = [str(path.relative_to(HOUSE)) for path in FILES]


def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _imports(tree: ast.AST) -> list[str]:
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            found.append(node.module)
            found.extend(f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            found.extend(alias.name for alias in node.names)
    return found


def _is_door(name: str) -> bool:
    return any(name.startswith(door) for door in DOORS)


@pytest.mark.parametrize("path", FILES, ids=NAMES)
def test_imports_point_down(path: Path) -> None:
    name = str(path.relative_to(HOUSE))
    room = name.split("/")[0]
    if room not in FLOOR:
        assert name == "__init__.py", f"{name} stands outside every room"
        return
    for module in _imports(_tree(path)):
        parts = module.split(".")
        if parts[0] == "delaytools" and len(parts) > 1 and parts[1] in FLOOR and parts[1] != room:
            assert FLOOR[parts[1]] < FLOOR[room], f"{name} imports {module}, which is not below it"


@pytest.mark.parametrize("path", FILES, ids=NAMES)
def test_no_import_hides_in_a_function(path: Path) -> None:
    name = str(path.relative_to(HOUSE))
    if name.startswith(("cli/", "studio/")) or name == "__init__.py":
        return
    for node in ast.walk(_tree(path)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            hidden = [n for n in ast.walk(node) if isinstance(n, ast.Import | ast.ImportFrom)]
            assert not hidden, f"{name}: {node.name} hides an import"


@pytest.mark.parametrize("path", FILES, ids=NAMES)
def test_only_doors_touch_the_world(path: Path) -> None:
    name = str(path.relative_to(HOUSE))
    if _is_door(name):
        return
    for node in ast.walk(_tree(path)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            assert node.func.id not in ("print", "open", "input", "eval", "exec"), (
                f"{name} calls {node.func.id}"
            )
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            assert node.func.attr not in ("write_text", "write_bytes", "read_text", "read_bytes"), name
        assert not isinstance(node, ast.Global), f"{name} has global state"


@pytest.mark.parametrize("path", FILES, ids=NAMES)
def test_classes_are_abstract_or_final(path: Path) -> None:
    for node in ast.walk(_tree(path)):
        if isinstance(node, ast.ClassDef):
            bases = [ast.unparse(base) for base in node.bases]
            marks = [ast.unparse(mark) for mark in node.decorator_list]
            abstract = bool({"ABC", "Protocol"} & set(bases)) or any(
                isinstance(item, ast.FunctionDef)
                and "abstractmethod" in [ast.unparse(d) for d in item.decorator_list]
                for item in node.body
            )
            base_of_tables = node.name.startswith("_") and bases == ["BaseModel"]
            trouble = any("Error" in base or base == "Exception" for base in bases)
            assert abstract or "final" in marks or trouble or base_of_tables, f"{path.name}: {node.name}"


@pytest.mark.parametrize("path", FILES, ids=NAMES)
def test_measures(path: Path) -> None:
    name = str(path.relative_to(HOUSE))
    text = path.read_text(encoding="utf-8")
    assert text.count("\n") <= 400, f"{name} has more than 400 lines"
    for node in ast.walk(_tree(path)):
        if not isinstance(node, ast.FunctionDef):
            continue
        assert (node.end_lineno or 0) - node.lineno < 50, f"{name}: {node.name} is longer than 50 lines"
        positional = [a for a in (*node.args.posonlyargs, *node.args.args) if a.arg not in ("self", "cls")]
        both = len(positional) + len(node.args.kwonlyargs)
        if not name.startswith("cli/"):
            assert both <= 7, f"{name}: {node.name} takes {both} parameters"
            assert node.args.kwarg is None, f"{name}: {node.name} takes **kwargs"


def test_no_cycles() -> None:
    graph = {
        name.removesuffix(".py").replace("/", ".").removesuffix(".__init__"): {
            module.removeprefix("delaytools.")
            for module in _imports(_tree(path))
            if module.startswith("delaytools.")
        }
        for name, path in zip(NAMES, FILES, strict=True)
    }
    done: set[str] = set()

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, " -> ".join((*path, module))
        if module in graph and module not in done:
            for other in graph[module]:
                visit(other, (*path, module))
            done.add(module)

    for module in graph:
        visit(module, ())


def test_public_face() -> None:
    names = [name for name in delaytools.__all__ if name != "__version__"]
    assert len(names) <= 30
    for name in names:
        assert getattr(delaytools, name).__doc__, f"{name} says nothing of itself"
    with pytest.raises(AttributeError, match="no attribute"):
        _ = delaytools.nothing_of_that_name

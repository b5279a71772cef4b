"""Formulas written as text: parsed into a tree of allowed operations, never evaluated as code."""

import ast
import math
import re
import unicodedata
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from keyword import iskeyword
from typing import Any, final

import numpy as np

from delaytools.signals.trouble import DesignError, shown

__all__ = ["FUNCTIONS", "Expression", "check_name", "constant", "signal_expression"]

FUNCTIONS = ("abs", "sign", "sin", "cos", "tan", "tanh", "exp", "log", "sqrt", "min", "max")
NUMPY: dict[str, Callable[..., Any]] = {
    "abs": np.abs,
    "sign": np.sign,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "tanh": np.tanh,
    "exp": np.exp,
    "log": np.log,
    "sqrt": np.sqrt,
    "min": np.minimum,
    "max": np.maximum,
}
_WORD = re.compile(r"[^\W\d]\w*")


def _power(a: Any, b: Any) -> Any:
    found = a**b
    if isinstance(found, complex):
        raise DesignError("a power that is no real number in a formula", found=f"({a:g})**({b:g})")
    return found


_BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: _power,
}


@final
@dataclass(frozen=True)
class Expression:
    """A formula over names, with + - * / **, parentheses, pi and the functions in `FUNCTIONS`.

    Raises DesignError, naming the piece of text, for anything else.
    """

    text: str

    def __post_init__(self) -> None:
        try:
            _check(self._tree, self.text)
        except RecursionError as error:
            raise DesignError(
                "a formula with too many terms", found=shown(self.text), advice="split it into several blocks"
            ) from error

    @cached_property
    def _tree(self) -> ast.expr:
        advice = "use names, numbers, + - * / ** and parentheses"
        if "#" in self.text:
            raise DesignError("a comment inside a formula", found=shown(self.text), advice="put it outside")
        try:
            return ast.parse(" ".join(self.text.split()), mode="eval").body
        except (MemoryError, RecursionError) as error:
            raise DesignError("a formula with too many terms", found=shown(self.text)) from error
        except (SyntaxError, ValueError) as error:
            words = [word for word in _WORD.findall(self.text) if iskeyword(word)]
            if words:
                advice = f"{words[0]} cannot be a name in a formula: rename it"
            raise DesignError("not a formula", found=shown(self.text), advice=advice) from error

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names that the formula reads, in the order of their first appearance."""
        found: dict[str, None] = {}
        _collect(self._tree, found)
        return tuple(found)

    def renamed(self, new: Mapping[str, str]) -> "Expression":
        """The formula with names replaced; new names may hold dots and other marks of a port."""
        if not set(new) & set(self.names):
            return self
        tree = _renamed(self._tree, new)
        expression = Expression.__new__(Expression)
        object.__setattr__(expression, "text", ast.unparse(tree))
        expression.__dict__["_tree"] = tree
        return expression

    def evaluate(self, values: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]] = NUMPY) -> Any:
        """The value of the formula where every name has its value (numbers, arrays or CasADi symbols).

        Raises DesignError for an unknown name, and where plain numbers are divided by zero or have no real power.
        """
        try:
            found = _evaluate(self._tree, values, functions)
        except (ZeroDivisionError, OverflowError) as error:
            problem = "a division by zero" if isinstance(error, ZeroDivisionError) else "a number too large"
            raise DesignError(f"{problem} in a formula", found=shown(self.text)) from error
        except RecursionError as error:
            raise DesignError("a formula with too many terms", found=shown(self.text)) from error
        return found


def check_name(name: str, what: str) -> None:
    """Raises DesignError for a name that no formula could read: not a word, or one that means something else."""
    if name in ("pi", *FUNCTIONS) or iskeyword(name):
        raise DesignError(
            f"{name!r} cannot be the name of a {what}",
            advice="it has a meaning of its own in formulas: choose another name",
        )
    if not (name.isidentifier() and unicodedata.normalize("NFKC", name) == name):
        raise DesignError(
            f"{name!r} cannot be the name of a {what}",
            advice="formulas read names of letters, digits and _ that begin with a letter",
        )


def constant(number: float) -> Expression:
    """The formula that is just a number."""
    return Expression(repr(float(number)))


def signal_expression(name: str) -> Expression:
    """The formula that is just one signal, whose name may hold dots and other marks of a port."""
    expression = Expression.__new__(Expression)
    object.__setattr__(expression, "text", name)
    expression.__dict__["_tree"] = ast.Name(id=name)
    return expression


def _collect(node: ast.AST, found: dict[str, None]) -> None:
    if isinstance(node, ast.Name):
        if node.id != "pi":
            found.setdefault(node.id)
        return
    children = node.args if isinstance(node, ast.Call) else ast.iter_child_nodes(node)
    for child in children:
        _collect(child, found)


def _renamed(node: ast.expr, new: Mapping[str, str]) -> ast.expr:
    match node:
        case ast.Name(id=name):
            return ast.Name(id=new.get(name, name))
        case ast.BinOp(left=left, op=op, right=right):
            return ast.BinOp(left=_renamed(left, new), op=op, right=_renamed(right, new))
        case ast.UnaryOp(op=op, operand=operand):
            return ast.UnaryOp(op=op, operand=_renamed(operand, new))
        case ast.Call(func=func, args=args):
            return ast.Call(func=func, args=[_renamed(arg, new) for arg in args], keywords=[])
    return node


def _check(node: ast.AST, text: str) -> None:
    match node:
        case ast.Constant(value=bool()):
            pass
        case ast.Name(id=name) if name in FUNCTIONS:
            advice = f"{name} is a function: write {name}(…), or rename the signal or parameter"
            raise DesignError(f"{name} without its argument in {shown(text)}", advice=advice)
        case ast.Constant(value=int() | float() as number):
            _check_constant(number, text)
            return
        case ast.Name():
            return
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            _check(left, text)
            _check(right, text)
            return
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            _check(operand, text)
            return
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in FUNCTIONS:
            _check_call(name, args, text)
            return
    raise DesignError(
        f"{shown(ast.unparse(node))} is not allowed in the formula {shown(text)}",
        known=["+ - * / **", "parentheses", "pi", *FUNCTIONS],
        advice="formulas are parsed, nothing else is evaluated",
    )


def _check_constant(number: float, text: str) -> None:
    if not abs(number) < 1e300:
        raise DesignError("a number too large", found=shown(text), advice="write a smaller number")


def _check_call(name: str, args: list[ast.expr], text: str) -> None:
    wanted = 2 if name in ("min", "max") else 1
    if len(args) < wanted or (wanted == 1 and len(args) > 1):
        values = "one value" if wanted == 1 else "two values or more"
        raise DesignError(f"{name} takes {values} in the formula {shown(text)}", found=f"{len(args)}")
    for arg in args:
        _check(arg, text)


def _evaluate(node: ast.AST, values: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]]) -> Any:
    match node:
        case ast.Constant(value=number):
            return float(number)  # type: ignore[arg-type]
        case ast.Name(id="pi") if "pi" not in values:
            return math.pi
        case ast.Name(id=name):
            if name not in values:
                raise DesignError("unknown name in a formula", found=repr(name), known=sorted(values))
            return values[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_evaluate(operand, values, functions)
        case ast.UnaryOp(operand=operand):
            return _evaluate(operand, values, functions)
        case ast.BinOp(left=left, op=op, right=right):
            return _BINARY[type(op)](_evaluate(left, values, functions), _evaluate(right, values, functions))
        case ast.Call(func=ast.Name(id=name), args=args):
            done = [_evaluate(arg, values, functions) for arg in args]
            result = done[0]
            if len(done) == 1:
                return functions[name](result)
            for other in done[1:]:
                result = functions[name](result, other)
            return result
    raise AssertionError(f"unchecked node {node!r}")

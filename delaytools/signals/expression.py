"""Formulas written as text: parsed into a tree of allowed operations, never evaluated as code."""

import ast
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from delaytools.signals.trouble import DesignError

__all__ = ["FUNCTIONS", "Expression", "constant", "signal_expression"]

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
_BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b,
}


@final
@dataclass(frozen=True)
class Expression:
    """A formula over names, with + - * / **, parentheses, pi and the functions in `FUNCTIONS`.

    Raises DesignError, naming the piece of text, for anything else.
    """

    text: str

    def __post_init__(self) -> None:
        _check(self._tree, self.text)

    @cached_property
    def _tree(self) -> ast.expr:
        try:
            return ast.parse(self.text.strip(), mode="eval").body
        except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
            raise DesignError(
                "not a formula",
                found=repr(self.text),
                advice="use names, numbers, + - * / ** and parentheses",
            ) from error

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
        """The value of the formula where every name has its value (numbers, arrays or CasADi symbols)."""
        return _evaluate(self._tree, values, functions)


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
        case ast.Constant(value=int() | float()) | ast.Name():
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
    found = ast.unparse(node) if isinstance(node, ast.AST) else str(node)
    raise DesignError(
        f"{found!r} is not allowed in the formula {text!r}",
        known=["+ - * / **", "parentheses", "pi", *FUNCTIONS],
        advice="formulas are parsed, nothing else is evaluated",
    )


def _check_call(name: str, args: list[ast.expr], text: str) -> None:
    wanted = 2 if name in ("min", "max") else 1
    if len(args) < wanted or (wanted == 1 and len(args) > 1):
        raise DesignError(f"{name} takes {wanted} value(s) in {text!r}", found=f"{len(args)}")
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

"""Arithmetic over a table's columns, as a mapping may say it: `v - w*b/2`. It is never executed as code."""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import ExpressionError

_BINARY: dict[type[ast.operator], Callable[[FloatArray, FloatArray], FloatArray]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_UNARY: dict[type[ast.unaryop], Callable[[FloatArray], FloatArray]] = {
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": np.abs,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "atan2": np.arctan2,
    "radians": np.radians,
    "unwrap": np.unwrap,
    "cumsum": np.cumsum,
}
CONSTANTS = {"pi": float(np.pi)}
ALLOWED = "columns, constants, numbers, + - * / **, brackets, and " + ", ".join(FUNCTIONS)
# A column whose name is no identifier stands in backticks.
_QUOTED = re.compile(r"`([^`]+)`")
_LONGEST = 500
_DEEPEST = 40


class Expression:
    """A parsed expression.

    Attributes
    ----------
    text : as it was written.
    names : the columns and constants that it takes, in the order in which they appear.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        if len(text) > _LONGEST:
            raise ExpressionError(text[:40] + "…", f"longer than {_LONGEST} characters", ALLOWED)
        self._quoted: dict[str, str] = {}
        try:
            self._tree = ast.parse(_QUOTED.sub(self._placeholder, text).strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise ExpressionError(text, "not an expression", ALLOWED) from None
        self.names = tuple(dict.fromkeys(self._names(self._tree, 0)))

    def evaluate(self, values: Mapping[str, FloatArray | float]) -> FloatArray:
        """The result for columns of shape (n,) and constants by name; a division by zero gives no number.

        Raises
        ------
        ExpressionError : a name is not among the values.
        """
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(self._value(self._tree, values), dtype=np.float64)

    def _placeholder(self, found: re.Match[str]) -> str:
        name = f"_quoted_{len(self._quoted)}"
        self._quoted[name] = found.group(1)
        return name

    def _names(self, node: ast.AST, depth: int) -> Iterator[str]:
        """The names in a tree, once each of its nodes is found to be allowed."""
        if depth > _DEEPEST:
            raise ExpressionError(self.text, "nested too deeply", ALLOWED)
        if isinstance(node, ast.Name):
            name = self._quoted.get(node.id, node.id)
            if name not in CONSTANTS:
                yield name
            return
        children: list[ast.expr]
        if isinstance(node, ast.Constant):
            if isinstance(node.value, bool) or not isinstance(node.value, (int, float)):
                raise ExpressionError(self.text, f"{node.value!r} is no number", ALLOWED)
            return
        if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
            children = [node.left, node.right]
        elif isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY:
            children = [node.operand]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            if node.func.id not in FUNCTIONS:
                raise ExpressionError(self.text, f"there is no function {node.func.id!r}", ALLOWED)
            count = 2 if node.func.id == "atan2" else 1
            if len(node.args) != count:
                raise ExpressionError(self.text, f"{node.func.id} takes {count} value(s)", ALLOWED)
            children = node.args
        else:
            raise ExpressionError(self.text, f"{type(node).__name__} is not allowed", ALLOWED)
        for child in children:
            yield from self._names(child, depth + 1)

    def _value(self, node: ast.AST, values: Mapping[str, FloatArray | float]) -> FloatArray:
        if isinstance(node, ast.Constant):
            assert isinstance(node.value, (int, float))
            return np.float64(node.value)  # type: ignore[return-value]
        if isinstance(node, ast.Name):
            name = self._quoted.get(node.id, node.id)
            if name in values:
                return np.asarray(values[name], dtype=np.float64)
            if name in CONSTANTS:
                return np.asarray(CONSTANTS[name])
            raise ExpressionError(self.text, f"there is no column or constant {name!r}", ALLOWED)
        if isinstance(node, ast.BinOp):
            return _BINARY[type(node.op)](self._value(node.left, values), self._value(node.right, values))
        if isinstance(node, ast.UnaryOp):
            return _UNARY[type(node.op)](self._value(node.operand, values))
        assert isinstance(node, ast.Call)
        assert isinstance(node.func, ast.Name)
        found = FUNCTIONS[node.func.id](*(self._value(argument, values) for argument in node.args))
        return np.asarray(found, dtype=np.float64)

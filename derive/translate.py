"""From the kernels' subset of Python to C.

The algorithms of a kernel (Newton's iteration, the integrator) are written once, in a subset of Python that numba
compiles as it is; this module prints the same functions in C, comments included. The subset: functions with annotated
arguments (``float``, ``int``, ``array``, ``indices`` and ``short_indices``, which are arrays of integers of 64 and of
32 bits that are read; ``integers``, of 32 bits, which may be written), assignments, ``if``, ``while``,
``for ... in range``, ``return``, arithmetic, comparisons, calls of math.h and of one another. Whatever lies
outside is refused.
"""

from __future__ import annotations

import ast
import io
import tokenize
from collections import Counter
from dataclasses import dataclass, field

from softdyn.derive.printing import MATH_FUNCTIONS

C_TYPES = {"float": "double", "int": "int64_t"}
#: Arrays of integers, which are read.
INDEX_TYPES = {"indices": "int64_t", "short_indices": "int32_t"}
#: Arrays of integers, which are written.
WRITTEN_TYPES = {"integers": "int32_t"}
BINARY = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
COMPARE = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
CONSTANTS = {"inf": "INFINITY", "nan": "NAN"}
#: What takes numbers apart by their bits, and has a text of its own for each target: templates ``bits``.
BIT_FUNCTIONS = {"_power_of_two", "_exponent", "_fraction"}
#: What lets threads wait for one another, likewise: templates ``grains``.
THREAD_FUNCTIONS = {"_wait"}
#: Functions that C has under the same name, besides int, float, range and empty, which have a translation.
KNOWN_FUNCTIONS = {*MATH_FUNCTIONS, *BIT_FUNCTIONS, *THREAD_FUNCTIONS, "isfinite", "int", "float", "range", "empty"}
PRECEDENCE = {ast.Add: 4, ast.Sub: 4, ast.Mult: 5, ast.Div: 5}


class TranslationError(Exception):
    """The text is outside the subset of Python that can be translated."""


@dataclass
class _Function:
    """What is known of the function being translated."""

    arrays: set[str]
    types: dict[str, str]
    written: set[str]
    assigned: dict[str, int] = field(default_factory=dict)
    declared: set[str] = field(default_factory=set)


def to_c(text: str) -> str:
    """C text of a module in the kernels' subset of Python; names that start with ``_`` become static inline.

    Raises
    ------
    TranslationError
        Naming the line outside the subset.
    """
    module = ast.parse(text)
    _require_subset(module)
    comments = _comments(text)
    functions = [node for node in module.body if isinstance(node, ast.FunctionDef)]
    written = _written_arrays(functions)
    tables = "".join(_table(node) for node in module.body if isinstance(node, ast.Assign))
    return (
        "\n\n".join([*filter(None, [tables.rstrip()]), *(_function(node, comments, written) for node in functions)])
        + "\n"
    )


def _is_table(node: ast.stmt) -> bool:
    """Whether a statement is NAME = table((number, ...))."""
    return (
        isinstance(node, ast.Assign)
        and len(node.targets) == 1
        and isinstance(node.targets[0], ast.Name)
        and isinstance(node.value, ast.Call)
        and ast.unparse(node.value.func) == "table"
        and len(node.value.args) == 1
        and isinstance(node.value.args[0], ast.Tuple)
    )


def _table(node: ast.Assign) -> str:
    assert isinstance(node.value, ast.Call)
    assert isinstance(node.value.args[0], ast.Tuple)
    numbers = [repr(float(ast.literal_eval(number))) for number in node.value.args[0].elts]
    rows = [", ".join(numbers[i : i + 4]) for i in range(0, len(numbers), 4)]
    text = ",\n    ".join(rows)
    return f"static const double {ast.unparse(node.targets[0])}[{len(numbers)}] = {{\n    {text},\n}};\n"


def _harmless(text: str) -> str:
    """Return text that ends no comment of C's early."""
    return text.replace("*/", "* /")


def _require_subset(module: ast.Module) -> None:
    """Refuse, with its line, whatever has no counterpart in C or means something else there."""
    functions = {node.name for node in module.body if isinstance(node, ast.FunctionDef)} | KNOWN_FUNCTIONS
    for statement in module.body:
        if _is_table(statement):
            continue
        if not isinstance(statement, ast.FunctionDef):
            raise TranslationError(
                f"line {statement.lineno}: a kernel holds functions and tables only, not {_shown(statement)}"
            )
        signature = statement.args
        if signature.defaults or signature.kwonlyargs or signature.posonlyargs or signature.vararg or signature.kwarg:
            raise TranslationError(f"line {statement.lineno}: {statement.name} may take plain arguments only")
        if statement.returns and ast.unparse(statement.returns) not in (*C_TYPES, "None"):
            raise TranslationError(f"line {statement.lineno}: {statement.name} returns no type of C's")
        for node in ast.walk(statement):
            if not _translatable(node, functions):
                line = getattr(node, "lineno", statement.lineno)
                raise TranslationError(f"line {line}: cannot translate {_shown(node)}")


def _shown(node: ast.AST) -> str:
    return repr(ast.unparse(node))


def _translatable(node: ast.AST, functions: set[str]) -> bool:
    """Whether a node, its children apart, has the same meaning in C; of functions, those that it may call."""
    if isinstance(node, ast.AugAssign):
        return type(node.op) in BINARY
    if isinstance(node, ast.AnnAssign):
        return ast.unparse(node.annotation) in C_TYPES
    if isinstance(node, ast.Compare):
        return len(node.ops) == 1 and type(node.ops[0]) in COMPARE
    if isinstance(node, ast.BoolOp):  # in Python the value of one of its terms, in C 0 or 1
        return all(_is_condition(value) for value in node.values)
    if isinstance(node, (ast.For, ast.While)):
        return not node.orelse and (isinstance(node, ast.While) or _is_plain_range(node.iter))
    if isinstance(node, ast.Call):
        known = isinstance(node.func, ast.Name) and node.func.id in functions
        return known and not node.keywords
    if isinstance(node, ast.Subscript):
        return not isinstance(node.slice, (ast.UnaryOp, ast.Slice, ast.Tuple))
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
        return abs(node.value) < (2**63 if isinstance(node.value, int) else float("inf"))
    return True


def _is_condition(node: ast.expr) -> bool:
    if isinstance(node, ast.Call):
        return isinstance(node.func, ast.Name) and node.func.id == "isfinite"
    return isinstance(node, (ast.Compare, ast.BoolOp)) or (
        isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)
    )


def _is_plain_range(node: ast.expr) -> bool:
    return isinstance(node, ast.Call) and ast.unparse(node.func) == "range" and len(node.args) == 1


def _comments(text: str) -> dict[int, str]:
    """Full-line comments, by line."""
    lines = text.splitlines()
    return {
        token.start[0]: _harmless(token.string.lstrip("# "))
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type == tokenize.COMMENT and lines[token.start[0] - 1].strip().startswith("#")
    }


def _written_arrays(functions: list[ast.FunctionDef]) -> dict[str, list[bool]]:
    """Which arguments of each function are arrays written to, by itself or by what it calls."""
    result = {f.name: [False] * len(f.args.args) for f in functions}
    stored = {f.name: _stored(f) for f in functions}
    calls = {f.name: [call for call in _calls(f) if call[0] in result] for f in functions}
    changed = True
    while changed:
        changed = False
        for function in functions:
            names = stored[function.name]
            for called, given in calls[function.name]:
                names |= {name for name, is_written in zip(given, result[called], strict=True) if is_written and name}
            flags = [argument.arg in names for argument in function.args.args]
            if flags != result[function.name]:
                result[function.name] = flags
                changed = True
    return result


def _stored(function: ast.FunctionDef) -> set[str]:
    """Arrays that a function itself writes to."""
    return {
        node.value.id
        for node in ast.walk(function)
        if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store) and isinstance(node.value, ast.Name)
    }


def _calls(function: ast.FunctionDef) -> list[tuple[str, list[str]]]:
    """What a function calls, and the names that it gives, "" for other arguments."""
    return [
        (node.func.id, [argument.id if isinstance(argument, ast.Name) else "" for argument in node.args])
        for node in ast.walk(function)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    ]


def _function(node: ast.FunctionDef, comments: dict[int, str], written: dict[str, list[bool]]) -> str:
    arguments, arrays, types = [], set(), {}
    for argument, is_written in zip(node.args.args, written[node.name], strict=True):
        kind = ast.unparse(argument.annotation) if argument.annotation else ""
        if kind in INDEX_TYPES:
            if is_written:
                raise TranslationError(f"line {node.lineno}: {argument.arg} of {node.name} is to be read, not written")
            arrays.add(argument.arg)
            arguments.append(f"const {INDEX_TYPES[kind]} *restrict {argument.arg}")
        elif kind in WRITTEN_TYPES:
            arrays.add(argument.arg)
            arguments.append(f"{'' if is_written else 'const '}{WRITTEN_TYPES[kind]} *restrict {argument.arg}")
        elif kind == "array":
            arrays.add(argument.arg)
            arguments.append(f"{'' if is_written else 'const '}double *restrict {argument.arg}")
        elif kind in C_TYPES:
            types[argument.arg] = kind
            arguments.append(f"{C_TYPES[kind]} {argument.arg}")
        else:
            raise TranslationError(f"line {node.lineno}: argument {argument.arg} of {node.name} needs a type")
    returns = C_TYPES[ast.unparse(node.returns)] if node.returns and ast.unparse(node.returns) != "None" else "void"
    state = _Function(arrays, types, set())
    for child in ast.walk(node):
        for target in _targets(child):
            state.assigned[target] = state.assigned.get(target, 0) + 1
    body = node.body
    docstring = ast.get_docstring(node)
    lines = []
    if docstring:
        body = body[1:]
        lines += _comment_block(docstring)
    static = "static inline " if node.name.startswith("_") else ""
    lines.append(f"{static}{returns} {node.name}({', '.join(arguments)})")
    lines.append("{")
    read = {child.id for child in ast.walk(node) if isinstance(child, ast.Name)}
    # what only some kernels of a kind use
    lines += [f"    (void){argument.arg};" for argument in node.args.args if argument.arg not in read]
    hoisted = _hoisted(body, state)
    for name, kind in hoisted.items():
        lines.append(f"    {C_TYPES[kind]} {name};")
        state.declared.add(name)
    lines += _block(body, state, comments, 1)
    lines.append("}")
    return "\n".join(lines)


def _comment_block(text: str) -> list[str]:
    first, *rest = _harmless(text).splitlines()
    block = [f"/* {first}", *(f"   {line}".rstrip() for line in rest)]
    block[-1] += " */"
    return block


def _targets(node: ast.AST) -> list[str]:
    if isinstance(node, ast.Assign):
        return [target.id for target in node.targets if isinstance(target, ast.Name)]
    if isinstance(node, (ast.AugAssign, ast.AnnAssign)) and isinstance(node.target, ast.Name):
        return [node.target.id]
    return []


def _blocks(statement: ast.stmt) -> list[list[ast.stmt]]:
    return [block for name in ("body", "orelse") if (block := getattr(statement, name, None))]


def _hoisted(body: list[ast.stmt], state: _Function) -> dict[str, str]:
    """Variables that are used outside the block in which they are first assigned: C wants them declared before it."""
    everywhere = _uses(body)
    seen: set[str] = set(state.types)
    found: dict[str, str] = {}

    def visit(block: list[ast.stmt]) -> None:
        here = _uses(block)
        for statement in block:
            for name in _targets(statement):
                if name not in seen and here[name] < everywhere[name]:
                    annotated = isinstance(statement, ast.AnnAssign)
                    found[name] = ast.unparse(statement.annotation) if annotated else "float"  # type: ignore[attr-defined]
                seen.add(name)
            for inner in _blocks(statement):
                visit(inner)

    visit(body)
    state.types.update(found)
    return found


def _uses(block: list[ast.stmt]) -> Counter[str]:
    return Counter(node.id for statement in block for node in ast.walk(statement) if isinstance(node, ast.Name))


def _block(body: list[ast.stmt], state: _Function, comments: dict[int, str], depth: int) -> list[str]:
    pad, lines = "    " * depth, []
    for statement in body:
        lines += [pad + f"/* {text} */" for text in _comments_before(statement, comments)]
        lines += [pad + line if line else line for line in _statement(statement, state, comments, depth)]
    return lines


def _comments_before(statement: ast.stmt, comments: dict[int, str]) -> list[str]:
    found: list[str] = []
    line = statement.lineno - 1
    while line in comments:
        found.insert(0, comments.pop(line))
        line -= 1
    return found


def _statement(node: ast.stmt, state: _Function, comments: dict[int, str], depth: int) -> list[str]:
    def inner(body: list[ast.stmt]) -> list[str]:
        return [line[4 * depth :] for line in _block(body, state, comments, depth + 1)]

    if isinstance(node, ast.Assign) and len(node.targets) == 1:
        return [_assignment(node.targets[0], node.value, state, None)]
    if isinstance(node, ast.AnnAssign) and node.value is not None:
        return [_assignment(node.target, node.value, state, ast.unparse(node.annotation))]
    if isinstance(node, ast.AugAssign):
        return [f"{_expr(node.target, state)} {BINARY[type(node.op)]}= {_expr(node.value, state)};"]
    if isinstance(node, ast.Return):
        return ["return;" if node.value is None else f"return {_expr(node.value, state)};"]
    if isinstance(node, ast.If):
        lines = [f"if ({_expr(node.test, state)}) {{", *inner(node.body)]
        while len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If):
            node = node.orelse[0]
            lines += [f"}} else if ({_expr(node.test, state)}) {{", *inner(node.body)]
        if node.orelse:
            lines += ["} else {", *inner(node.orelse)]
        return [*lines, "}"]
    if isinstance(node, ast.While):
        return [f"while ({_expr(node.test, state)}) {{", *inner(node.body), "}"]
    if isinstance(node, ast.For) and isinstance(node.target, ast.Name) and isinstance(node.iter, ast.Call):
        name = node.target.id
        state.types[name] = "int"
        (stop,) = node.iter.args
        head = f"for (int64_t {name} = 0; {name} < {_expr(stop, state)}; {name}++) {{"
        return [head, *inner(node.body), "}"]
    if isinstance(node, (ast.Continue, ast.Break)):
        return ["continue;" if isinstance(node, ast.Continue) else "break;"]
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        return [f"{_expr(node.value, state)};"]
    raise TranslationError(f"line {node.lineno}: cannot translate {ast.unparse(node)!r}")


def _assignment(target: ast.expr, value: ast.expr, state: _Function, kind: str | None) -> str:
    if isinstance(target, ast.Name) and isinstance(value, ast.Call) and ast.unparse(value.func) == "empty":
        state.arrays.add(target.id)
        return f"double {target.id}[{ast.unparse(value.args[0])}];"
    text = f"{_expr(target, state)} = {_expr(value, state)};"
    if isinstance(target, ast.Name) and target.id not in state.declared and target.id not in state.types:
        state.types[target.id] = kind or "float"
        state.declared.add(target.id)
        const = "const " if state.assigned[target.id] == 1 else ""
        return f"{const}{C_TYPES[state.types[target.id]]} {text}"
    return text


def _expr(node: ast.expr, state: _Function) -> str:
    return _text(node, state)[0]


def _text(node: ast.expr, state: _Function) -> tuple[str, int]:
    """Text and precedence: 0 conditional, 1 or, 2 and, 3 comparison, 4 sum, 5 product, 6 unary, 7 atom."""
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
        return repr(node.value), 7
    if isinstance(node, ast.Name):
        return CONSTANTS.get(node.id, node.id), 7
    if isinstance(node, ast.BinOp) and type(node.op) in BINARY:
        level = PRECEDENCE[type(node.op)]
        right_level = level + isinstance(node.op, (ast.Sub, ast.Div, ast.Mult, ast.Add))
        left, right = _at(node.left, state, level), _at(node.right, state, right_level)
        if isinstance(node.op, ast.Div) and _is_integer(node.left, state) and _is_integer(node.right, state):
            left = f"(double){_at(node.left, state, 6)}"  # C would cut the quotient
        return f"{left} {BINARY[type(node.op)]} {right}", level
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.Not)):
        return ("-" if isinstance(node.op, ast.USub) else "!") + _at(node.operand, state, 7), 6
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        left, right = _at(node.left, state, 4), _at(node.comparators[0], state, 4)
        return f"{left} {COMPARE[type(node.ops[0])]} {right}", 3
    if isinstance(node, ast.BoolOp):
        # C programmers' compilers ask for parentheses around && within ||
        symbol = " && " if isinstance(node.op, ast.And) else " || "
        return symbol.join(_at(value, state, 3) for value in node.values), 2 if symbol == " && " else 1
    if isinstance(node, ast.IfExp):
        parts = (_at(part, state, 1) for part in (node.test, node.body, node.orelse))
        return "{} ? {} : {}".format(*parts), 0
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in C_TYPES:
        return f"({C_TYPES[node.func.id]}){_at(node.args[0], state, 6)}", 6
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        return f"{node.func.id}({', '.join(_expr(argument, state) for argument in node.args)})", 7
    if isinstance(node, ast.Subscript):
        return f"{_expr(node.value, state)}[{_expr(node.slice, state)}]", 7
    raise TranslationError(f"line {node.lineno}: cannot translate {ast.unparse(node)!r}")


def _is_integer(node: ast.expr, state: _Function) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int)
    if isinstance(node, ast.Name):
        return state.types.get(node.id) == "int"
    if isinstance(node, ast.UnaryOp):
        return _is_integer(node.operand, state)
    if isinstance(node, ast.BinOp):
        return not isinstance(node.op, ast.Div) and _is_integer(node.left, state) and _is_integer(node.right, state)
    return isinstance(node, ast.Call) and ast.unparse(node.func) == "int"


def _at(node: ast.expr, state: _Function, level: int) -> str:
    text, own = _text(node, state)
    return text if own >= level else f"({text})"

"""Mutation check of the automaton: `python test/exact/mutants.py [part of a name]`, some minutes.

Deletes or negates every branch of `grasp_ros.exact.modes` in turn, drops every operand of an `and` or `or`, one side of
every loop over both sides, and every statement that calls or stores something. A test of test_modes.py must fail for
each of these mutants, but for those that do what the original does; they are listed with the reason. Everything
runs uncompiled, each mutant in a fork.
"""

from __future__ import annotations

import ast
import copy
import os
import sys
import types
from collections.abc import Iterator
from pathlib import Path

os.environ["NUMBA_DISABLE_JIT"] = "1"
sys.path.insert(0, str(Path(__file__).parents[1]))

TESTS = Path(__file__).parent / "test_modes.py"
MODULE = "grasp_ros.exact.modes"
EQUIVALENT = {
    "close_resting_pair: drop y[U_L + side] == 0.0: "
    "mode[side] == Pair.OPEN and y[U_L + side] == 0.0 and (approach(y, side) == 0.0)":
        "an open pair has u <= 0, and `mode_of` calls u < 0 open; said because it is the rule",
}


class Mutant:
    """A changed tree, and what was changed."""

    def __init__(self, name: str, tree: ast.Module) -> None:
        self.name, self.tree = name, tree


def mutants(source: str) -> Iterator[Mutant]:
    """All mutants of a source."""
    tree = ast.parse(source)
    for function in (node for node in tree.body if isinstance(node, ast.FunctionDef)):
        for node in ast.walk(function):
            for change, replacement in changes(node):
                name = f"{function.name}: {change}: {ast.unparse(node).splitlines()[0]}"
                yield Mutant(name, replaced(tree, node, replacement))


def changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """What can be done to a node: a word for it, and the node that takes its place."""
    if isinstance(node, (ast.If, ast.IfExp)):
        yield "negate", altered(node, test=ast.UnaryOp(ast.Not(), node.test))
    if isinstance(node, ast.If):
        yield "delete branch", altered(node, body=[ast.Pass()])
        if node.orelse:
            yield "delete else", altered(node, orelse=[])
    if isinstance(node, ast.BoolOp):
        for k, operand in enumerate(node.values):
            left = [*node.values[:k], *node.values[k + 1 :]]
            yield f"drop {ast.unparse(operand)}", left[0] if len(left) == 1 else altered(node, values=left)
    if isinstance(node, ast.For) and isinstance(node.iter, ast.Tuple):
        for kept in node.iter.elts:
            yield f"only {ast.unparse(kept)}", altered(node, iter=ast.Tuple([kept], ast.Load()))
    stores = isinstance(node, (ast.Assign, ast.AugAssign)) and not isinstance(target_of(node), (ast.Name, ast.Tuple))
    calls = isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    if stores or calls:
        yield "delete", ast.Pass()


def target_of(node: ast.Assign | ast.AugAssign) -> ast.expr:
    """Where an assignment stores."""
    return node.targets[0] if isinstance(node, ast.Assign) else node.target


def altered(node: ast.AST, **fields: object) -> ast.AST:
    """A copy of a node with other fields."""
    result = copy.copy(node)
    for name, value in fields.items():
        setattr(result, name, value)
    return result


def replaced(tree: ast.Module, old: ast.AST, new: ast.AST) -> ast.Module:
    """A copy of a tree with one node replaced."""
    memo = {id(old): copy.deepcopy(new)}
    return ast.fix_missing_locations(copy.deepcopy(tree, memo))


def survives(mutant: Mutant) -> bool:
    """Whether all tests pass with a mutant in place of the module."""
    child = os.fork()
    if child == 0:
        os._exit(run_tests(mutant))
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def run_tests(mutant: Mutant) -> int:
    """Run the tests on a mutant; returns pytest's exit status."""
    import pytest

    module = types.ModuleType(MODULE)
    exec(compile(mutant.tree, MODULE, "exec"), module.__dict__)
    sys.modules[MODULE] = module
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    return int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "-W", "ignore", str(TESTS)]))


def main() -> int:
    """Print the survivors; returns 1 if one of them is not listed as equivalent, or a listed one was killed."""
    import exact.bench  # noqa: F401 - imported once, before the forks
    import pytest  # noqa: F401

    from grasp_ros.exact import modes

    source = Path(modes.__file__).read_text()
    assert survives(Mutant("none", ast.parse(source))), "the tests fail without any mutation"
    found = [mutant for mutant in mutants(source) if not sys.argv[1:] or sys.argv[1] in mutant.name]
    alive = [mutant.name for mutant in found if survives(mutant)]
    for name in alive:
        print(f"survives: {name}\n    {EQUIVALENT.get(name, 'NOT EXPECTED')}")
    for name in EQUIVALENT.keys() - set(alive):
        print(f"listed as equivalent, but killed or gone: {name}")
    print(f"{len(found)} mutants, {len(found) - len(alive)} killed, {len(alive)} survive, {len(EQUIVALENT)} equivalent")
    return 0 if set(alive) == EQUIVALENT.keys() else 1


if __name__ == "__main__":
    sys.exit(main())

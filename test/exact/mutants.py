"""Mutation check of the automaton: `python test/exact/mutants.py [part of a name]`, some minutes.

Deletes or negates every branch of `modes`, `resting_pair`, `begin` and `clamp_surface` in turn, drops every operand of
an `and` or `or`, one side of every loop over both sides, and every statement that calls or stores something. A test of
the file of the same name, test_modes.py ..., must fail for each of these mutants, but for those that do what the
original does; they are listed with the reason. Everything runs uncompiled, each mutant in a fork.
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

ROOM = "grasp_ros.exact.automaton"
MODULES = ("modes", "resting_pair", "begin", "clamp_surface")
EQUIVALENT: dict[str, str] = {
    "impact_beside: drop u <= 0.0: state.mode[beside] != Pair.CONTACT or u <= 0.0": "at u = 0 all terms are 0",
    **{f"make_transitions: drop {side}.when <= last: {side}.when <= last and {side}.what == Transition.CLAMP and"
       f" glides(plant, state, {side.upper()})": "it is asked again below; here it spares the price"
       for side in ("left", "right")},
    "parts: delete branch: if not d < 0.0:": "at u' >= 0 the comparison below is false; here it spares two differences",
    "settle_resting: delete branch: if not (waits_l or waits_r):": "without a pair that waits nothing changes",
}


class Mutant:
    """A changed tree of a module, and what was changed."""

    def __init__(self, module: str, name: str, tree: ast.Module) -> None:
        self.module, self.name, self.tree = module, name, tree


def mutants(module: str, source: str) -> Iterator[Mutant]:
    """All mutants of a module's source."""
    tree = ast.parse(source)
    for function in (node for node in tree.body if isinstance(node, ast.FunctionDef)):
        for node in ast.walk(function):
            for change, replacement in changes(node):
                name = f"{function.name}: {change}: {ast.unparse(node).splitlines()[0]}"
                yield Mutant(module, name, replaced(tree, node, replacement))


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

    name = f"{ROOM}.{mutant.module}"
    module = types.ModuleType(name)
    exec(compile(mutant.tree, name, "exec"), module.__dict__)
    sys.modules[name] = module
    tests = Path(__file__).parent / f"test_{mutant.module}.py"
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    return int(pytest.main(["-x", "-q", "-m", "not slow", "-p", "no:cacheprovider", "-W", "ignore", str(tests)]))


def main() -> int:
    """Print the survivors; returns 1 if one of them is not listed as equivalent, or a listed one was killed."""
    import exact.bench  # noqa: F401 - imported once, before the forks
    import pytest  # noqa: F401

    from grasp_ros.exact.automaton import modes

    found: list[Mutant] = []
    for module in MODULES:
        source = Path(modes.__file__).with_name(f"{module}.py").read_text()
        assert survives(Mutant(module, "none", ast.parse(source))), f"the tests of {module} fail without any mutation"
        found += [mutant for mutant in mutants(module, source) if not sys.argv[1:] or sys.argv[1] in mutant.name]
    alive = []
    for mutant in filter(survives, found):
        alive.append(mutant.name)
        print(f"survives: {mutant.name}\n    {EQUIVALENT.get(mutant.name, 'NOT EXPECTED')}", flush=True)
    for name in EQUIVALENT.keys() - set(alive):
        print(f"listed as equivalent, but killed or gone: {name}")
    print(f"{len(found)} mutants, {len(found) - len(alive)} killed, {len(alive)} survive, {len(EQUIVALENT)} equivalent")
    return 0 if set(alive) == EQUIVALENT.keys() else 1


if __name__ == "__main__":
    sys.exit(main())

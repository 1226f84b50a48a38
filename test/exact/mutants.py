"""Mutation check of the automaton and the event search: `python test/exact/mutants.py [part of a name]`, minutes.

Deletes or negates every branch of MODULES in turn, drops every operand of an `and` or `or`, one side of every loop over
both sides, and every statement that calls or stores something. A test of the module's own files must fail for each of
these mutants, but for those that do what the original does; they are listed with the reason. Everything runs
uncompiled, each mutant in a fork.

`--sample N [--seed S]` draws N mutants of another kind: a comparison with or without its edge, a sum in place of a
difference, a product in place of a quotient, a sign dropped, a number doubled; also in SAMPLED,
whose branches are changed only where a part of a name asks for it.
Many of them change nothing but a rounding or the price: docs/quality.md has those that survived, with reasons.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib
import os
import random
import signal
import sys
import types
from collections.abc import Callable, Iterator
from pathlib import Path

os.environ["NUMBA_DISABLE_JIT"] = "1"
sys.path[:0] = map(str, Path(__file__).parents[1:3])  # tests and checkout, whatever is installed

ROOM = "grasp_ros.exact"
MODULES = {  # and the files of their tests
    "automaton.modes": ("modes",), "automaton.edge": ("edge",), "automaton.begin": ("begin",),
    "automaton.friction": ("friction", "modes"),
}
SAMPLED = {"flight.search": ("flight",), "numerics.roots": ("roots",)}  # not every branch is tested there
LONGEST_S = 120  # of the tests of a mutant
EDGES = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
OPERATIONS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
EQUIVALENT: dict[str, str] = {
    "automaton.edge: other_push: drop u <= 0.0: state.mode[opposite] != Pair.CONTACT or u <= 0.0":
        "at u = 0 all terms are 0",
    **{f"automaton.modes: make_transitions: drop {side}.when <= last: {side}.when <= last and {side}.what =="
       f" Transition.CLAMP and glides(plant, state, {side.upper()})":
       "it is asked again below; here it spares the price" for side in ("left", "right")},
    "automaton.edge: separates: delete branch: if not d < 0.0:":
        "at u' >= 0 the comparison below is false; here it spares two differences",
    "automaton.modes: settle_resting: delete branch: if not (waits_l or waits_r):":
        "without a pair that waits nothing changes",
    "automaton.friction: slide_in_contact: delete branch: if low > 0.0 if slide == Slide.RIGHTWARD else high < 0.0:":
        "a velocity that keeps its sign has no root; here it spares the search",
    "automaton.friction: slide_in_contact: delete branch: if stays_stuck(tables, plant, state.mode, h):":
        "what the bounds prove the series of the impacts find, too",
    "automaton.friction: slide_in_contact: delete branch: if not found.when <= h:":
        "what never reaches the friction does not exceed it by its rounding; here it spares the second search",
}


class Mutant:
    """A changed tree of a module, and what was changed."""

    def __init__(self, module: str, name: str, tree: ast.Module) -> None:
        self.module, self.name, self.tree = module, name, tree


def mutants(module: str, source: str, changes: Callable[[ast.AST], Iterator[tuple[str, ast.AST]]]) -> Iterator[Mutant]:
    """All mutants of a module's source by some kind of changes."""
    tree = ast.parse(source)
    for function in (node for node in tree.body if isinstance(node, ast.FunctionDef)):
        for node in (node for statement in function.body for node in ast.walk(statement)):
            for change, replacement in changes(node):
                name = f"{module}: {function.name}: {change}: {ast.unparse(node).splitlines()[0]}"
                yield Mutant(module, name, replaced(tree, node, replacement))


def arithmetic(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """What can be done to the comparison, the operation, the sign or the number at a node, as in `branches`."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in EDGES:
        edge = EDGES[type(node.ops[0])]
        yield f"to {edge.__name__}", altered(node, ops=[edge(), *node.ops[1:]])
    if isinstance(node, (ast.BinOp, ast.AugAssign)) and type(node.op) in OPERATIONS:
        operation = OPERATIONS[type(node.op)]
        yield f"to {operation.__name__}", altered(node, op=operation())
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield "drop sign", node.operand
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        yield "double", altered(node, value=2 * node.value or 1)


def branches(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """What can be done to the flow at a node: a word for it, and the node that takes its place."""
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
    own = {id(known): word for word, known in vars(importlib.import_module(name)).items() if callable(known)}
    for user in [user for user in sys.modules.values() if user.__name__.startswith(ROOM)]:  # who imported its functions
        for word, known in list(vars(user).items()):
            if id(known) in own:
                setattr(user, word, vars(module)[own[id(known)]])
    sys.modules[name] = module
    signal.alarm(LONGEST_S)  # a loop that does not end is noticed, too
    tests = [f"{Path(__file__).parent}/test_{name}.py" for name in {**MODULES, **SAMPLED}[mutant.module]]
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    quickly = "-m", "not slow", "-k", "not chain"  # chains are runs of minutes where nothing is compiled
    return int(pytest.main(["-x", "-q", *quickly, "-p", "no:cacheprovider", "-W", "ignore", *tests]))


def drawn(only: str, sample: int, seed: int) -> list[Mutant]:
    """All mutants of the branches with a part in their name, or a sample of those of the arithmetic."""
    from grasp_ros.exact import __file__ as room

    found: list[Mutant] = []
    for module in (*MODULES, *SAMPLED) if sample or only else MODULES:
        source = Path(room).parent.joinpath(*module.split(".")).with_suffix(".py").read_text()
        own = [mutant for mutant in mutants(module, source, arithmetic if sample else branches)
               if only in mutant.name]
        if own and not survives(Mutant(module, "none", ast.parse(source))):
            sys.exit(f"the tests of {module} fail without any mutation")
        found += own
    return random.Random(seed).sample(found, min(sample, len(found))) if sample else found


def main() -> int:
    """Print the survivors; returns 1 if one of the branches is not listed as equivalent, or a listed one was killed."""
    import exact.bench  # noqa: F401 - imported once, before the forks
    import pytest  # noqa: F401

    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("only", nargs="?", default="", help="part of a name")
    parser.add_argument("--sample", type=int, default=0, help="that many of the arithmetic")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    found = drawn(options.only, options.sample, options.seed)
    expected = {} if options.sample else {name: why for name, why in EQUIVALENT.items() if options.only in name}
    alive = []
    for mutant in filter(survives, found):
        alive.append(mutant.name)
        print(f"survives: {mutant.name}\n    {expected.get(mutant.name, 'NOT EXPECTED')}", flush=True)
    for name in expected.keys() - set(alive):
        print(f"listed as equivalent, but killed or gone: {name}")
    print(f"{len(found)} mutants, {len(found) - len(alive)} killed, {len(alive)} survive, {len(expected)} equivalent")
    return 0 if options.sample or set(alive) == expected.keys() else 1


if __name__ == "__main__":
    sys.exit(main())

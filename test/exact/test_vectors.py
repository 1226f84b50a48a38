"""Vectors of kernels: each of their numbers is what it would be alone, compiled or not."""

import numpy as np

from grasp_ros.exact.compilation.fma import fma
from grasp_ros.exact.compilation.jit import door, kernel
from grasp_ros.exact.compilation.vectors import (
    WIDTH,
    add_product,
    highest,
    larger,
    load,
    numbers_of,
    sizes,
    spread,
    store,
    vector_of,
)
from grasp_ros.exact.records import Array


@kernel
def fused(a: float, b: float, c: float) -> float:
    return fma(a, b, c)


@door
def combine(a: Array, b: Array, number: float, out: Array) -> float:
    """Every operation once, in rows of `out`."""
    x, y = load(a, 1), load(b, 1)  # from anywhere in an array
    store(out, 0, x + y)
    store(out, WIDTH, number * x - y * number)
    store(out, 2 * WIDTH, add_product(x, y, x))
    store(out, 3 * WIDTH, add_product(x, y, number))
    store(out, 4 * WIDTH, larger(x, y) - spread(number))
    store(out, 5 * WIDTH, vector_of(numbers_of(sizes(x))))
    return highest(x)


def test_each_number_has_the_bits_that_it_would_have_alone() -> None:
    a, b = np.random.default_rng(5).normal(size=(2, WIDTH + 2)) * 10.0 ** np.arange(-5, 5)
    number, out = 1.0 / 3.0, np.zeros(6 * WIDTH)
    high = combine(a, b, number, out)
    x, y = a[1 : 1 + WIDTH], b[1 : 1 + WIDTH]
    expected = [
        x + y, number * x - y * number, [fused(p, q, p) for p, q in zip(x, y, strict=True)],
        [fused(q, number, p) for p, q in zip(x, y, strict=True)], np.maximum(abs(x), abs(y)) - number,
        abs(x),
    ]
    assert out.tolist() == np.concatenate(expected).tolist()
    assert high == x.max()

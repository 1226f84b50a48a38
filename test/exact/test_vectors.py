"""Vectors of kernels: each of their numbers is what it would be alone, compiled or not."""

from typing import Any

import numpy as np
import pytest

from grasp_ros.exact.compilation.jit import door, kernel
from grasp_ros.exact.compilation.vectors import (
    HALF,
    WIDTH,
    add_product,
    fma,
    highest,
    larger,
    load,
    load_half,
    numbers_of,
    sizes,
    spread,
    spread_half,
    store,
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
    numbers = numbers_of(sizes(x))
    for i in range(WIDTH):
        out[5 * WIDTH + i] = numbers[i]
    return highest(x)


@door
def combine_halves(a: Array, b: Array, number: float, out: Array) -> float:
    """The same of half the width, as far as there is something of it."""
    x, y = load_half(a, 1), load_half(b, 1)
    store(out, 0, x + y)
    store(out, HALF, number * x - y * number)
    store(out, 2 * HALF, add_product(x, y, x))
    store(out, 3 * HALF, add_product(x, y, number))
    store(out, 4 * HALF, larger(x, y) - spread_half(number))
    return highest(x)


@pytest.mark.parametrize(("kernel_of", "width"), [(combine, WIDTH), (combine_halves, HALF)])
def test_each_number_has_the_bits_that_it_would_have_alone(kernel_of: Any, width: int) -> None:
    a, b = np.random.default_rng(5).normal(size=(2, WIDTH + 2)) * 10.0 ** np.arange(-5, 5)
    number, out = 1.0 / 3.0, np.zeros(6 * WIDTH)
    high = kernel_of(a, b, number, out)
    x, y = a[1 : 1 + width], b[1 : 1 + width]
    expected = [
        x + y, number * x - y * number, [fused(p, q, p) for p, q in zip(x, y, strict=True)],
        [fused(q, number, p) for p, q in zip(x, y, strict=True)], np.maximum(abs(x), abs(y)) - number,
        abs(x),
    ]
    expected = np.concatenate(expected)[: 5 * width if width == HALF else None]
    assert out[: len(expected)].tolist() == expected.tolist()
    assert high == x.max()

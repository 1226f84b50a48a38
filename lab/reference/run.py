"""Steps of the reference, and its outputs."""

from __future__ import annotations

import math

import gmpy2
from gmpy2 import mpfr

from lab.reference.automaton import Automaton, gaps
from lab.reference.motion import Pair
from lab.reference.plant import OBJECT, SIDES, Plant, Real, Reals, State
from lab.reference.roots import bound_at, first_crossing, value_at
from lab.reference.series import Expansion, expand, reach

EXTRA_DIGITS = 10  # of a step beyond those asked for
EXPONENTS = 1 << 40  # nothing overflows
EXTRA_BITS = 110  # of the arithmetic beyond those of a step
ORDER = 1.2  # of a series, for each digit: the cheapest
SAME = 1000  # steps' errors within which events are one instant
STILL = 40  # events in a row that last no time: the modes contradict each other
NEAR = 10  # steps from u = 0: there w is the better variable
FAR = 12  # shortest time scales: so long a wait is flown at once
Row = tuple[Real, ...]  # x_l, v_l, x_o, v_o, x_r, v_r


class Spent(Exception):  # noqa: N818 - an instant, not an error
    """The steps are used up."""


def precision(digits: int) -> int:
    """Bits of the arithmetic in which so many digits survive."""
    return math.ceil((digits + EXTRA_DIGITS) * math.log2(10)) + EXTRA_BITS


class Run(Automaton):
    """One integration with outputs at ascending times; within a context of `precision(digits)`.

    Each step keeps so many digits, and some more; `budget` is the limit of steps. `rows` are the states at the outputs
    reached.
    """

    def __init__(self, plant: Plant, x: Reals, v: Reals, outputs: Reals, digits: int, budget: float) -> None:
        super().__init__(plant, x, v, mpfr(10) ** -(digits + EXTRA_DIGITS))
        self.order = math.ceil(ORDER * (digits + EXTRA_DIGITS))
        self.rows: list[Row] = []
        self.steps = 0
        self._outputs = list(outputs)
        self._budget = budget
        self._lasted = mpfr(0)  # duration of the last step

    def advance(self, end: Real) -> None:
        """Go on to a time.

        Raises Spent if the steps are used up, and what was reached stays; RuntimeError if the modes contradict each
        other.
        """
        still = 0
        while self.state.t < end:
            if self.steps >= self._budget:
                raise Spent
            before = self.state.t
            self._step(end)
            still = 0 if self.state.t > before else still + 1
            if still > STILL:
                raise RuntimeError(f"the modes {self.pairs} {self.slide} last no time at t = {float(before)} s")
        while self._outputs and self._outputs[0] <= end:
            self._outputs.pop(0)
            self._write(self.state)

    def _step(self, end: Real) -> None:
        """One flight in closed form, or one series, cut at the first event."""
        self.steps += 1
        before = self.state.t
        if not self._fly(end):
            series, h, ends, far = self._expand(end)
            crossings = [(first_crossing(gap.row, h, gap.noise), gap) for gap in gaps(self, series, h, far)]
            fired = [(s, gap) for s, gap in crossings if s is not None]
            h = min((s for s, _ in fired), default=h)
            self._emit(series, h, end, far)
            target = self._at(series, h, far)
            self.state = target._replace(t=end if ends and not fired else target.t)
            if fired:
                self.fire([gap for s, gap in fired if s <= h + SAME * self.tolerance * h])
            else:
                self.finish()
        self._lasted = self.state.t - before

    def _fly(self, end: Real) -> bool:
        """Without a pressed pair: a step that no event can be within, if it is long enough to be worth while."""
        if self.pressed or Pair.STARTING in self.pairs:
            return False
        moving = [*self.arms, *self.free]
        left = end - self.state.t
        t = min(self.quiet(), left)
        if t < left and t * max(self.acting.body(body).rate for body in moving) < FAR:
            return False
        while self._outputs and self._outputs[0] < min(self.state.t + t, end):
            self._write(self.drifted(self._outputs.pop(0) - self.state.t, moving))
        self.state = self.drifted(t, moving)._replace(t=end if t == left else self.state.t + t)
        return True

    def _expand(self, end: Real) -> tuple[Expansion, Real, bool, list[int]]:
        """A series, its step, whether that ends the interval, and the arms that are left out because they are far."""
        far = [side for side in self.arms if self.pressed and self.pairs[side] in (Pair.OPEN, Pair.ABSENT)]
        series = self._series([side for side in self.arms if side not in far])
        h, ends = self._length(series, end)
        way = h * bound_at(series.x[OBJECT][1:], h) if far else mpfr(0)
        if not any(self.may_meet(side, bound_at(series.t, h), way) for side in far):
            return series, h, ends, far
        series = self._series(self.arms)
        return series, *self._length(series, end), []

    def _series(self, arms: list[int]) -> Expansion:
        w = self.state.w
        rooted = [side for side in self.pressed
                  if not w[side] or w[side] ** 2 < NEAR * self._lasted * abs(self.rate(side))]
        return expand(self.acting, self.state, [*arms, *self.free], self.wall, self.pressed, rooted, self.order)

    def _length(self, series: Expansion, end: Real) -> tuple[Real, bool]:
        """A step as far as the series hold, starting pairs have no impulse, and the interval lasts."""
        h = reach(series, self.tolerance)
        for side in SIDES:
            if self.pairs[side] is Pair.STARTING:
                h = self._harmless(side, series, h)
        left = end - self.state.t
        if not series.rooted:
            return min(h, left), h >= left
        # beyond a release the time runs backwards: its end at h tells nothing
        found = first_crossing([left, *(-a for a in series.t[1:])], h, mpfr(0))
        return (h, False) if found is None else (found, True)

    def _harmless(self, side: int, series: Expansion, h: Real) -> Real:
        """A step so short that the impact force left out of it gives no speed."""
        law, mass = self.plant.law(side), self.plant.reduced_mass(side, self.wall)
        u_row, rate_row = series.depth(side)[1:], series.rate(side)
        h = min(h, mpfr(1))
        while True:
            u, rate = h * bound_at(u_row, h), bound_at(rate_row, h)
            impulse = law.hertzian * u * gmpy2.sqrt(u) * (1 + law.dissipation * rate) * bound_at(series.t, h)
            if impulse <= self.tolerance * mass * rate:
                return h
            h /= 4

    def _at(self, series: Expansion, s: Real, far: list[int]) -> State:
        """The state at s; arms that are far fly."""
        state = series.at(s, self.state)
        apart = self.drifted(state.t - self.state.t, far)
        for side in far:
            state.x[side], state.v[side] = apart.x[side], apart.v[side]
        return state

    def _emit(self, series: Expansion, h: Real, end: Real, far: list[int]) -> None:
        """States at the outputs before the end of a step."""
        last = min(self.state.t + value_at(series.t, h), end)
        while self._outputs and self._outputs[0] < last:
            t = self._outputs.pop(0) - self.state.t
            s = first_crossing([t, *(-a for a in series.t[1:])], h, mpfr(0)) if series.rooted else t
            self._write(self._at(series, h if s is None else s, far))

    def _write(self, state: State) -> None:
        self.rows.append(tuple(value for body in (0, OBJECT, 1) for value in (state.x[body], state.v[body])))

"""An independent high-precision oracle: slow, and right to as many digits as asked for.

It shares nothing with the integrators of this package but the records of `physics` and the scenes. Flights are matrix
exponentials, contacts Taylor series in a variable in which the impact force is smooth, or in the time. Every event is
the first root of a polynomial on a step, found with certainty; where that starts at zero the first derivative that
differs decides. At a corner, where pairs are at u = 0 together or without speed, the impact force is left out while its
impulse is below the accuracy, and only there.

    plant      numbers of bodies and pairs, flight in closed form
    roots      polynomials and their first roots
    series     Taylor series of a mode
    motion     state and modes
    automaton  what ends a mode, and transitions
    run        steps and outputs
    solve      scenes, and their derivatives
"""

from lab.reference.solve import Reference, integrate

__all__ = ["Reference", "integrate"]

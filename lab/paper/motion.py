"""What is tested of one motion: rises and rates of V, enclosure of the object, convergence, periods, contacts."""

from __future__ import annotations

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Status
from grasp_ros.physics.energy import energy, pairs_of
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Of, Transition
from grasp_ros.physics.lyapunov import largest_deformation
from grasp_ros.physics.model import Array, Mode, hertzian_force
from grasp_ros.physics.system import COLUMN, System
from grasp_ros.scene import Scene
from grasp_ros.simulation import Trajectory, simulate
from lab.paper.cases import text_of
from lab.paper.measures import measure, seconds, settlings
from lab.paper.universal import Found, threshold

ROUNDING = 1e-12  # of V(0)
BESIDE = 1e-9  # s, on both sides of an event
RETURN = 1e-3  # distance to the start, in the norm of V, that counts as a return; of sqrt(V(0))
WHOLE = 20.0  # s
LAST = 1.0  # s, through which a grip must press
DRIFT = 1e-9  # of V_c or of a displacement, that counts as none
EXACT = 1e-9  # s, an error of a time that counts as none
ORDER = 0.1  # how much more than h^2 |u'' / u'| / 8 counts as of second order, since u'' is not constant
SHARE = 1e-3  # of the clearance of (37) that rounding may take, in epsilon

_RUNS: dict[str, Trajectory] = {}


def run_of(scene: Scene) -> Trajectory:
    """A motion over its horizon, with output times on both sides of every event; remembered."""
    text = text_of(scene)
    if text not in _RUNS:
        events = simulate(scene, grid=np.array([0.0])).event_table[:, 0]
        beside = np.concatenate([events - BESIDE, events + BESIDE])
        inside = beside[(beside > 0.0) & (beside < scene.duration)]
        _RUNS[text] = simulate(scene, grid=np.unique(np.concatenate([np.linspace(0.0, scene.duration, 4001), inside])))
    return _RUNS[text]


@threshold("rise of V between output times <= 1e-12 V(0)")
def paper_V_falls(scene: Scene) -> Found:
    """The paper's V never rises, across events too."""
    return _rise(run_of(scene).energy.V)


@threshold("rise of V_c between output times <= 1e-12 V(0)")
def repaired_V_falls(scene: Scene) -> Found:
    """V_c never rises."""
    return _rise(run_of(scene).energy.V_c)


def _rise(level: Array) -> Found:
    """The largest rise from one output time to the next, in the level of the begin."""
    rise = float(np.diff(level).max() / level[0])
    return Found(rise, rise <= ROUNDING)


@threshold("largest V' <= 1e-12 V(0) a second")
def rate_is_never_positive(scene: Scene) -> Found:
    """V' of (18), (23), (31) to (34) is <= 0 in each condition of contact."""
    level = run_of(scene).energy
    rate = float(level.V_rate.max() / level.V[0])
    return Found(rate, rate <= ROUNDING)


@threshold("clearance above -0.001 eps, with eps the largest deformation of the run", least=True)
def enclosed(scene: Scene) -> Found:
    """(37): x_l - eps_l < x_o < x_r + eps_r; equality at the instant of the largest deformation."""
    state = run_of(scene).state
    epsilon = largest_deformation(scene.system, state)[-1]
    x_l, x_o, x_r = (state[:, COLUMN[body]] for body in (LEFT, OBJECT, RIGHT))
    clearance = min(float((x_o - x_l + epsilon[LEFT]).min()), float((x_r + epsilon[RIGHT] - x_o).min()))
    share = clearance / max(float(epsilon.max()), 1e-300)
    return Found(share, share >= -SHARE)


@threshold("smallest p u' while u > 0: above -1", least=True)
def separates_slowly(scene: Scene) -> Found:
    """No pair separates faster than 1/p while it penetrates."""
    slowest = min(
        float((contact.dissipation * d)[u > 0.0].min(initial=0.0))
        for _, contact, u, d in pairs_of(scene.system, run_of(scene).state)
    )
    return Found(slowest, slowest > -1.0)


@threshold("smallest term >= 0 W", " W", least=True)
def collision_term_lowers(scene: Scene) -> Found:
    """The collision terms of (18) are never negative."""
    term = min(
        float((2.0 * contact.dissipation * hertzian_force(contact, u) * d * d).min())
        for _, contact, u, d in pairs_of(scene.system, run_of(scene).state)
    )
    return Found(term, term >= 0.0)


@threshold("V' = 0 in flight; lost more than 1 % of V(0)")
def falls_only_in_contact(scene: Scene) -> Found:
    """V' is 0 without contact and V falls in contact."""
    level = run_of(scene).energy
    lost = float(1.0 - level.V_c[-1] / level.V_c[0])
    return Found(lost, not level.V_rate[level.mode == int(Mode.NONE)].any() and lost > 0.01)


@threshold("all masses stay within 2 % before the limit of time")
def converges(scene: Scene) -> Found:
    """All masses settle, within the time that is looked at."""
    time = measure(scene, "settling")
    return Found(time, bool(np.isfinite(time)), f"{float(f'{time:.2g}'):g} s" if np.isfinite(time) else "never")


def converges_wherever(scene: Scene) -> Found:
    """The same from starts that cannot be told apart, and the range of their times."""
    times = settlings(scene)
    return Found(max(times), bool(np.isfinite(times).all()), seconds(times))


@threshold(f"V_c changes by at most {DRIFT:g}")
def keeps_V(scene: Scene) -> Found:
    """Neither grows nor decays: V_c stays what it is."""
    level = run_of(scene).energy.V_c
    drift = float(np.abs(level / level[0] - 1.0).max())
    return Found(drift, drift <= DRIFT)


def state_weights(system: System) -> Array:
    """Square roots of K, m, K, m_o, K, m: the norm of a state is then sqrt(V) without contacts; the object by K_l."""
    m, K = system.bodies[:, Of.MASS], system.closed_loop[:, Of.STIFFNESS]
    return np.asarray(np.sqrt(np.array([K[LEFT], m[LEFT], K[LEFT], m[OBJECT], K[RIGHT], m[RIGHT]])))


def distance_of_states(scene: Scene, a: Array, b: Array) -> Array:
    """Distance of states (..., 6) in the norm of `state_weights`."""
    return np.asarray(np.linalg.norm((np.asarray(a) - b) * state_weights(scene.system), axis=-1))


def nearest_return(scene: Scene, seconds: float) -> tuple[float, float]:
    """When a motion comes back nearest to its start, in s, and how near, in sqrt(V(0)).

    The first swing away from the start does not count: it ends where the distance is largest within the first second.
    """
    scene = scene.changed({"time.duration_s": seconds})
    step = 1e-3
    grid = np.linspace(0.0, seconds, round(seconds / step) + 1)
    states = simulate(scene, grid=grid).state
    start = scene.initial_state
    distance = distance_of_states(scene, states, start)
    away = int(np.argmax(distance[: round(1.0 / step)]))
    best = away + int(np.argmin(distance[away:]))
    fine = np.linspace(max(grid[best] - step, 0.0), min(grid[best] + step, seconds), 2001)
    close = distance_of_states(scene, simulate(scene, grid=fine).state, start)
    level = float(np.sqrt(energy(scene.system, start).V_c))
    return float(fine[int(np.argmin(close))]), float(close.min()) / level


@threshold(f"it comes back to its start within {WHOLE:g} s, to {RETURN:g} of sqrt(V(0))", least=True)
def returns(scene: Scene) -> Found:
    """A periodic motion comes back to its start within the paper's 20 s."""
    _, near = nearest_return(scene, WHOLE)
    return Found(near, near <= RETURN)


@threshold(f"both impact forces above 0 N through the last {LAST:g} s", " N", least=True)
def holds_on(scene: Scene) -> Found:
    """A grasp in the sense of a grip: both arms press the object all through the last second, N."""
    run = run_of(scene)
    force = float(run.impacts[run.t >= scene.duration - LAST].min())
    return Found(force, force > 0.0)


@threshold(f"moved within 20 s: at most {DRIFT:g} of its displacement")
def object_stays(scene: Scene) -> Found:
    """An object at rest off its origin stays where it is: how far it has moved after 20 s, in its displacement."""
    _, moved = _off_origin(scene)
    return Found(float(moved.max()), bool(moved.max() <= DRIFT))


@threshold("moved before the first touch: 0")
def object_rests_until_touched(scene: Scene) -> Found:
    """The same up to the first touch."""
    run, moved = _off_origin(scene)
    touches = run.event_table[run.event_table[:, 2] == Transition.TOUCH, 0]
    before = moved[run.t < (touches[0] if len(touches) else np.inf)].max()
    return Found(float(before), bool(before == 0.0))


def _off_origin(scene: Scene) -> tuple[Trajectory, Array]:
    """A motion whose object begins off its origin, and how far it has moved, in its displacement."""
    offset = float(0.5 * min(abs(scene.initial_state[0]), scene.initial_state[4]))
    run = run_of(scene.changed({"object.position_m": offset}))
    return run, np.abs(run.state[:, 2] - offset) / offset


def _first(run: Trajectory) -> tuple[float, float, float]:
    """Time, side and u' of the first touch."""
    table = run.event_table
    time, side, _, _, speed = table[table[:, 2] == Transition.TOUCH][0, :5].tolist()
    return time, side, speed


def _theirs(scene: Scene, step: float) -> Trajectory:
    """The paper's method, output at both ends."""
    return simulate(scene, grid=np.array([0.0, scene.duration]), method="paper", setting=step)


@threshold(f"error of the first time of contact at most {EXACT:g} s", " s")
def first_contact_error(step: float, scene: Scene) -> Found:
    """Error of the paper's interpolated time of the first contact, in s."""
    error = abs(_first(_theirs(scene, step))[0] - _first(simulate(scene, grid=np.array([0.0])))[0])
    return Found(error, error <= EXACT)


@threshold(f"error over h^2 |u'' / u'| / 8: at most {1.0 + ORDER:g}")
def second_order(step: float, scene: Scene) -> Found:
    """The same error over that of linear interpolation, at most |u'' / u'| h^2 / 8, with u'' before the touch."""
    time, side, speed = _first(simulate(scene, grid=np.array([0.0])))
    half = 0.5 * min(step, time)
    before = simulate(scene, grid=time - half * np.array([2.0, 1.0, 0.0])).state
    u = (before[:, 0] - before[:, 2]) if side == LEFT else (before[:, 2] - before[:, 4])
    curved = float(u @ [1.0, -2.0, 1.0]) / half**2
    allowed = abs(curved / speed) * step**2 / 8.0 + EXACT
    share = first_contact_error(step, scene).value / allowed
    return Found(share, share <= 1.0 + ORDER)


def touches(run: Trajectory) -> int:
    """Touches of both sides."""
    return int(np.count_nonzero(run.event_table[:, 2] == Transition.TOUCH))


@threshold("touches found over those that are there: at least 1", least=True)
def none_missed(step: float, scene: Scene) -> Found:
    """The paper's method finds no fewer touches than there are; on another path it can be more."""
    there_are = touches(simulate(scene, grid=np.array([0.0, scene.duration])))
    share = touches(_theirs(scene, step)) / max(there_are, 1)
    return Found(share, share >= 1.0)


@threshold("it reaches the end, and has touched", " touches")
def goes_on(step: float, scene: Scene) -> Found:
    """The paper's method reaches its end, however many touches come; their number."""
    run = _theirs(scene, step)
    return Found(touches(run), run.status is Status.DONE and touches(run) > 0)


def without_object(scene: Scene) -> Scene:
    """The arms alone: nothing to collide with."""
    alone = ("object", "left_contact", "right_contact")
    kept = {name: numbers for name, numbers in scene.values.items() if name not in alone}
    return scenes.compose(scene.name, kept)

"""Methods of integration: `exact` and others.

`registry.METHODS` is the table of all; `registry.check` refuses what a method cannot do; `Method.solve` runs it.

To add a method, write a function of a `Problem` that returns a `Solution`, both in `contract`, and a row of the table.
The contract, which a test checks for every row:

1.  Given are a `System`, a duration, output times, one setting, two budgets, and, for some methods, a drive. They are
    read, never written; the method keeps nothing from one call to the next.
2.  Delivered are the states (n, 6) at the output times, new in memory, the events, the counters of the work, and a
    status. Equal problems give equal bits.
3.  Output times ascend within [0, duration]. They may repeat, need not contain either end, and may be none at all.
    Neither a state nor an event depends on the other output times, to the last bit: they cost no step and shorten none.
    At t = 0 the state is the initial one. Behind the last of them the method goes on to the end of the horizon.
4.  Events ascend in time. A row is time, side, kind (`layout.Transition`), u and u'. A method that declares `events`
    records every touch and release that it finds, and every passage through u' = -1/p; any other delivers no row.
5.  What the motion does is never an exception. A run that cannot go on ends with a `Status` other than DONE and with
    the states and events up to there, the first of those that a run without a budget has. The first event beyond
    `max_events` ends it with EVENT_BUDGET; that event and others of the same instant may be recorded as well. A method
    that declares `work_budget` ends with WORK_BUDGET when `max_work` is spent.
6.  Counters are whole numbers, named by an enum, `counters`, the same for every problem.
7.  The setting is a step in s, a tolerance or an accuracy: `knob` says which. Less is finer. The row of the table
    says what is allowed and what is worth a measurement.
8.  A method treats the paper's grasp under continuous feedback. If it declares `effects` it treats whatever a scene can
    name: bodies and contacts that are absent, whose columns it may leave at 0, constant forces, friction. If it
    declares `sampled` it hands an `Integrator` to `Problem.drive`, if there is one, and takes the states from it;
    `Problem.sampled` then says whether the controllers are in the drive or in the system.
9.  What a method does not declare is refused before it is asked, by `registry.check` and in its words: unknown methods,
    settings out of range, packages that are missing, effects, sampled feedback, a budget of work. `solve` itself may
    rely on that.
"""

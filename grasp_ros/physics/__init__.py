"""Physics: equations, energies, control laws. NumPy only: no ROS, no files, no clocks, no compiled code.

Notation. All numbers are SI; the line points to the right, i stands for l or r.

==============  =====================  =========  ==========================================================
symbol          identifier             unit       meaning, sign, equation of the paper
==============  =====================  =========  ==========================================================
x_l, x_o, x_r   x_l, x_o, x_r          m          positions of left arm, object, right arm; (1) to (3)
v_i, v_o        v_l, v_o, v_r          m/s        velocities
m, m_o          mass, object_mass      kg         masses
k, c            stiffness, damping     N/m, Ns/m  spring and damper of an arm; (1), (2)
Kp, Kv          position_gain, ...     N/m, Ns/m  feedback f = -Kp x - Kv x'; (4), (5)
f_l, f_r        force, command         N          input forces, positive to the right
u_l, u_r        u                      m          x_l - x_o, x_o - x_r: positive is penetration; (8)
u'              d, u_rate              m/s        positive is approach
fw_l, fw_r      impact_force           N          never negative: it pushes arm and object apart; (6), (7)
H               hertzian               N/m^1.5    Hertzian stiffness; (6), (7)
p               dissipation            s/m        Hunt-Crossley dissipation; (6), (7), contact needs u' >= -1/p; (10)
V, V'           V, V_rate              J, W       the paper's Lyapunov function and its rate; (16), (18)
V_c             V_c                    J          V with the Hertz term of every pair with u >= 0
w, s, G         w, s, g                           regularised variables of a contact, see `exact.contact.series`
==============  =====================  =========  ==========================================================

The impact law is that of Hunt and Crossley (1975), with its tension cut off by (10): fw = H u^(3/2) max(0, 1 + p u')
for u >= 0. `docs/explanation/model.md` says what p is in the laws of other authors.

`model` has arm and contact as records and the impact force of any state, `impact_law` the force of a contact, `control`
the law of a controller, `system` puts a scene into arrays, `layout` says what stands where in them, `energy` computes V
and its balance, `sampled` the limits of a loop of held commands. `errors` has the exception for refused input, here and
in all packages.
"""

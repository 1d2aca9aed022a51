"""What a result of two particles can hold."""

#: Quantities that a result can hold besides t, h and delta; F and dF_dt are the external force and its rate.
QUANTITIES = ("X", "a", "F", "dF_dt", "zeta", "F_adh", "C", "D", "dh_dt", "ddelta_dt", "dX_dt", "lambda1", "lambda2")

"""The reference's equations in the hands of SciPy's ``solve_ivp``."""

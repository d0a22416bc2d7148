"""Arrays, factorization and quadratic programs, shared by all of the core."""

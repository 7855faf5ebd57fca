"""The judges: one module per criterion family, with the same names as in ``submissions/criteria``."""

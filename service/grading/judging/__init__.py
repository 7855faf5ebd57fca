"""What each criterion makes of the trials; a module a family, named as in ``submissions/criteria``."""

"""The database: who submitted what, the jobs, and what came of them."""

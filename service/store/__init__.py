"""Database tables, queries and job transitions. Contains no grading or rendering code."""

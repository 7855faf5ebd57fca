"""Grading of one submission against one assignment: run plan, trial runs, and marks."""

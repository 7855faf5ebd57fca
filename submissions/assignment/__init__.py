"""Assignments: their files, read, checked and put in the form that grading needs."""

"""Assignments: readers, validation, and the form that grading uses."""

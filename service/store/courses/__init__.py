"""Settings of a course: frozen assignments, deadlines and attempts, and hidden names."""

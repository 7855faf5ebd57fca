"""Systematic changes of programs: mutants with one fault each. Measures how well an assignment finds faults."""

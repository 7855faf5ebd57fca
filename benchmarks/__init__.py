"""Benchmarks: measurements of Robomark's speed and memory, with a budget for each. Run them with ``make bench``."""

"""The static analyser of student source: it reads the files of a submission and says what stands in them, and where.

It runs in a child, as a parser can be made to crash; ``service/grading/static_analysis.py`` asks it.
"""

"""Static analysis of student source code: which names and constructs the files of a submission contain, and where.

It runs in a child, because crafted source can crash a parser. ``service/grading/static_analysis.py`` calls it.
"""

"""Families of packaged classifiers, one module each: training data and test places.

Training and evaluation are shared by all families; see ``training.py`` and ``evaluation.py``.
"""

from sim.discovery import import_all

import_all(__name__, __path__)

"""The families of packaged classifiers, a module each: what it is trained on and where it is tested.

How they are trained and measured is the same for all, and stands in ``training.py`` and ``evaluation.py``.
"""

from sim.discovery import import_all

import_all(__name__, __path__)

"""The plots of a grade, a floor and a classifier, one module each. ``drawn.py`` lists the plots of a grade."""

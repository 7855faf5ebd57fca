"""The plots of a grade, a floor and a classifier, one module each. ``grade_plots.py`` lists the plots of a grade."""

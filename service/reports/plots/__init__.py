"""The plots of a grade, a floor and a classifier, a module each; ``drawn.py`` says which of them a grade has."""

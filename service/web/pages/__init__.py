"""The pages: one module for each subject, each with a ``router``. ``access.py`` checks the readers' permissions."""

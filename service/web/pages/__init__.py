"""What people see: a module for each thing that they do, each with a ``router``. Who may see it says ``access.py``."""

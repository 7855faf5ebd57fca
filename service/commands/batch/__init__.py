"""``robomark batch``, a module for each kind of command; ``app.py`` puts them together."""

"""``robomark batch``: one module for each kind of command. ``app.py`` combines them."""

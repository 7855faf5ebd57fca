"""``robomark models``: one module for each kind of command."""

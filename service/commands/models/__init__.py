"""``robomark models``, a module for each kind of command."""

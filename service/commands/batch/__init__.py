"""``robomark batch``: one module for each kind of command. ``service/command_table.py`` lists them."""

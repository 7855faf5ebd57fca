"""Names of the course's nn_tools that responder code uses; what only draws or animates does nothing here."""

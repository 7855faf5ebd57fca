"""How alike submissions are, in what is written and in what their robots did: for staff to look at, never marks."""

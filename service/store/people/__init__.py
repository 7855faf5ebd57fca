"""Who there is: students, who instructs, how they sign in, and who is told of what happens."""

"""The processes in which all student code runs, and the layers that keep it there."""

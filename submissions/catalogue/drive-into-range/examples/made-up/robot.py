# Stays where it is, and prints what it should have been answered.
print("PY::here")
print("Answer: Py saw: here")

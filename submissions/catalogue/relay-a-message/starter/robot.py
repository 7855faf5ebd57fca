# The first robot: what does it see, and whom does it tell?
print("PY::hello")

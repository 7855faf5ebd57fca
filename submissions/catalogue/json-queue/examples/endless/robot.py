import ev3dev2_glue as glue

print("PY::0")
# Waits for the answer without ever letting time pass.
while len(glue.pyState()["messages"]) < 1:
    pass
print("PY::2")

import time
import ev3dev2_glue as glue

print("PY::0")
# Nothing waits here, so no answer can have come yet.
print("Last message", glue.pyState()["messages"][-1])
time.sleep(1)
print("PY::2")
time.sleep(1)
print("PY::4")
time.sleep(1)
say("Last Python message was ..." + glue.pyState()["messages"][-1]["message"])

import time
import ev3dev2_glue as glue

print("PY::hello")
time.sleep(0.5)
# Has the answer come? If not, turn a little and send the message again.
print(glue.pyState()["messages"])

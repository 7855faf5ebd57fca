import time
import ev3dev2_glue as glue

print("PY::What does it see?")
# The answer takes a tenth of a second, and the first robot has not even looked.
say(glue.pyState()["messages"][0]["news"])

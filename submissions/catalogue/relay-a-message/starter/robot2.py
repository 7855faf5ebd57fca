import time
import ev3dev2_glue as glue

# The second robot: whom can it ask?
time.sleep(1)
print(glue.pyState()["messages"])

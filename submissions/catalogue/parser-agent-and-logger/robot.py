import time
import ev3dev2_glue as glue

for text in ("0", "[1, 2, 3]", '{"key": "value"}', "my message"):
    print("PY::" + text)
    time.sleep(1)
    print("Message queue", glue.pyState())

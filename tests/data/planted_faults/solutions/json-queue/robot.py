import time
from ev3dev2_glue import pyState

numbers = [0, 2, 4]
for number in numbers:
    print(f"PY::{number}")
    time.sleep(2)

messages = pyState()["messages"]
newest = messages[len(messages) - 1]
say("Last Python message was ..." + newest["message"])

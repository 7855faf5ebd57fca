import time
import ev3dev2_glue as glue

print("IMG_DATA")
while not glue.pyState()["messages"]:
    time.sleep(0.1)
message = glue.pyState()["messages"][-1]["message"]
say("The MLP reads " + message["mlp"] + ", the CNN " + message["cnn"])

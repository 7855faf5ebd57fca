%%sim_magic_preloaded -b MNIST_Digits -x 600 -y 750 -a 90
import time
import ev3dev2_glue as glue

print("IMG_DATA")
while not glue.pyState()["messages"]:
    time.sleep(0.1)
say("That is a " + glue.pyState()["messages"][-1]["message"]["digit"])

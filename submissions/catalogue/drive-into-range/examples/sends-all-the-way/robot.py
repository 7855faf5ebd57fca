import time
import ev3dev2_glue as glue

tank_drive.on(SpeedPercent(30), SpeedPercent(30))

while not glue.pyState()["messages"]:
    print("PY::here")
    time.sleep(0.3)

tank_drive.off()
print("Answer:", glue.pyState()["messages"][-1]["message"])

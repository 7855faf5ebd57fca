import time
import ev3dev2_glue as glue

tries = 0
while tries < 40:
    tries = tries + 1
    print("PY::hello")
    time.sleep(0.5)
    if glue.pyState()["messages"]:
        break
    tank_drive.on_for_rotations(SpeedPercent(-20), SpeedPercent(20), 0.5)
answers = glue.pyState()["messages"]
print("Answer:", answers[0]["message"])

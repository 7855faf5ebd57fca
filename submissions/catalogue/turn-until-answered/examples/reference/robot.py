import time
import ev3dev2_glue as glue

for _ in range(40):
    print("PY::hello")
    time.sleep(0.5)
    messages = glue.pyState()["messages"]
    if messages:
        print("Answer:", messages[-1]["message"])
        break
    # About 30 degrees on the spot.
    tank_turn.on_for_rotations(-100, SpeedPercent(30), 0.52)

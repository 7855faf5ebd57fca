import time
import ev3dev2_glue as glue

tank_turn.on(-100, SpeedPercent(20))
for _ in range(200):
    print("PY::hello")
    time.sleep(0.05)
tank_turn.off()
print("Answer:", glue.pyState()["messages"][-1]["message"])

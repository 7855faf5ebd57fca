import time

time.sleep(1)
seen = "black" if colorLeft.reflected_light_intensity_pc < 10 else "grey"
print("PY::I see " + seen)
time.sleep(0.2)

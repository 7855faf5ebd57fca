import time

light = colorLeft.reflected_light_intensity_pc
if light < 20:
    print("PY::I see black")
else:
    print("PY::I see grey")
time.sleep(1)

import time

print("IMG_DATA")
time.sleep(1)

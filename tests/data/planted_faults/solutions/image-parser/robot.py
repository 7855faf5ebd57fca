import time

print("PY::{'test_key':'test value'}")
time.sleep(1)
print("IMG_DATA")
time.sleep(1)
